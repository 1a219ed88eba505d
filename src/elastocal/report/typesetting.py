"""A typst document to a PDF, with the data and pictures that it reads beside it."""

from __future__ import annotations

import json
import shutil
import tempfile
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

import typst

from elastocal.io.atomic_writes import atomic_write

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

    from elastocal.io.origin import Origin


def compile_document(
    path: str | Path,
    document: str,
    data: Mapping[str, Any],
    figures: Iterable[str] = (),
    origin: Origin | None = None,
    package: str = __package__,
) -> None:
    """Compile a document; the PDF appears whole or not at all.

    `path`: the PDF. `document`: file name of the document. `data`: JSON-serialisable contents of the files
    ``<name>.json`` that the document reads. `figures`: PDF files; the document finds them by their names. `origin`: what the
    document shows in its foot and has in its metadata: the contents of ``origin.json``, empty without. `package`: has the
    document.
    """
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / document
        # A document imports what it shares with the others, which stands here.
        beside = (each for name in {__package__, package} for each in resources.files(name).iterdir())
        for each in beside:
            if each.name.endswith(".typ"):
                Path(folder, each.name).write_text(each.read_text(encoding="utf-8"), encoding="utf-8")
        if not source.is_file():
            raise FileNotFoundError(document)
        for name, contents in {**data, "origin": "" if origin is None else origin.words}.items():
            (Path(folder) / f"{name}.json").write_text(json.dumps(contents, allow_nan=False), encoding="utf-8")
        for figure in figures:
            shutil.copy(figure, folder)
        with atomic_write(path) as partial:
            typst.compile(source, output=Path(partial), format="pdf", root=source.parent)
