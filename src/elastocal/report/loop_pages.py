"""Pages of a campaign's report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.report.typesetting import compile_document

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from elastocal.io.origin import Origin


def write_loop_report(path: str | Path, facts: dict[str, Any], figures: Sequence[str], origin: Origin | None = None) -> None:
    """Compile the report of a campaign; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `loop_facts.loop_facts`. `figures`: PDF files, named before_after, residuals, arrows,
    candidates and, where there are pairs, confounding. `origin`: named in the foot of each page.
    """
    names = [Path(figure).stem for figure in figures]
    compile_document(path, "loop.typ", {"facts": facts | {"figures": names}}, figures, origin)
