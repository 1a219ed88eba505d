"""Pages of the blind proof."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.report.typesetting import compile_document

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path
    from typing import Any

    from elastocal.io.origin import Origin


def write_blind_report(
    path: str | Path, facts: Mapping[str, Any], figures: Iterable[str], origin: Origin | None = None
) -> None:
    """Compile the report of the blind proof; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `blind_facts.blind_facts`. `figures`: PDF files, named targets, reliability, power,
    confusion, errors, coverage and sweep. `origin`: named in the foot of each page.
    """
    compile_document(path, "blind.typ", {"facts": facts}, figures, origin, __package__)
