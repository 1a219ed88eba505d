"""Pages of the study's report: a typst document over its tables, figures and answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.report.typesetting import compile_document

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path
    from typing import Any

    from elastocal.io.origin import Origin


def write_report(
    path: str | Path,
    facts: Mapping[str, Any],
    tables: Mapping[str, Sequence[Sequence[str]]],
    figures: Iterable[str],
    origin: Origin | None = None,
) -> None:
    """Compile the report; the file appears whole or not at all.

    `path`: the PDF. `facts`: from `answers.answers`. `tables`: rows of each table, the header first. `figures`: PDF files, and
    the bibliography; the document finds them by their names. `origin`: named in the foot of each page.
    """
    compile_document(path, "study.typ", {"facts": facts, "tables": tables}, figures, origin)
