"""Pages of the report: a typst document over the tables, figures and answers of the study."""

import json
import shutil
import tempfile
from importlib import resources
from pathlib import Path

import typst

from elastocal.whole_files import appearing_whole


def write_report(path, facts, tables, figures):
    """Compile the report; the file appears whole or not at all.

    Parameters
    ----------
    path : str
        The PDF.
    facts : dict
        From `answers.answers`.
    tables : dict of str to list of list of str
        Rows of each table, the header first.
    figures : iterable of str
        PDF files; the document finds them by their names.
    """
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "study.typ"
        source.write_text(
            resources.files("elastocal.report").joinpath("study.typ").read_text(encoding="utf-8"), encoding="utf-8"
        )
        (Path(folder) / "facts.json").write_text(json.dumps(facts, allow_nan=False), encoding="utf-8")
        (Path(folder) / "tables.json").write_text(json.dumps(tables, allow_nan=False), encoding="utf-8")
        for figure in figures:
            shutil.copy(figure, folder)
        with appearing_whole(path) as partial:
            typst.compile(source, output=partial, format="pdf", root=folder)
