"""A typst document of this folder to a PDF, with the data and pictures that it reads beside it."""

import json
import shutil
import tempfile
from importlib import resources
from pathlib import Path

import typst

from elastocal.io.atomic_writes import atomic_write


def compile_document(path, document, data, figures=()):
    """Compile a document; the PDF appears whole or not at all.

    Parameters
    ----------
    path : str
        The PDF.
    document : str
        File name of the document in this folder.
    data : dict of str to object
        JSON-serialisable contents of the files ``<name>.json`` that the document reads.
    figures : iterable of str
        PDF files; the document finds them by their names.
    """
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / document
        source.write_text(resources.files("elastocal.report").joinpath(document).read_text(encoding="utf-8"), encoding="utf-8")
        for name, contents in data.items():
            (Path(folder) / f"{name}.json").write_text(json.dumps(contents, allow_nan=False), encoding="utf-8")
        for figure in figures:
            shutil.copy(figure, folder)
        with atomic_write(path) as partial:
            typst.compile(source, output=partial, format="pdf", root=folder)
