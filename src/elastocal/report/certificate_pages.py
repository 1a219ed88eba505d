"""Pages of a certificate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.report.typesetting import compile_document

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path
    from typing import Any


def write_certificate(path: str | Path, facts: Mapping[str, Any], figures: Iterable[str]) -> None:
    """Compile a certificate; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `certificate_words.certificate_facts`. `figures`: PDF files, named workspace and budget.
    """
    compile_document(path, "certificate.typ", {"facts": facts}, figures)
