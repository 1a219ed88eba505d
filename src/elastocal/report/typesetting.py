"""Templates and the data that they show: sentences and pages by Jinja, documents by
Typst."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.io.atomic_writes import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

    from jinja2 import Template

    from elastocal.io.origin import Origin

# Tags of a template that fill a whole line.
_LINE_OF_TAGS = re.compile(r"^[ \t]*((?:\{%(?:(?!%\}).)*%\})+)[ \t]*\n", re.MULTILINE)
# A section of a template of sentences: marks, name and text.
_SECTION = re.compile(r"^(##?) (\w+)\n(.*?)(?=^##? \w+\n|\Z)", re.DOTALL | re.MULTILINE)
_EMPTY_LINES = r"\n[ \n]*\n"
# Separator of the cells of a row, and the character that replaces it in a value, such as a
# serial number, until the cells are separated. The latter is a private-use character of
# Unicode, which has no meaning of its own.
_SEPARATOR = "¦"
_SEPARATOR_IN_VALUE = "\ue0a6"


def load_template(name: str, filters: Mapping[str, Any] | None = None) -> Template:
    """Load a template of this package with additional filters, such as `words.FILTERS`;
    pages (.html) escape the facts that they show."""
    return _compile_template(name, _read_template(name), tuple((filters or {}).items()))


# A command renders the same sentences several times, and compiling a template takes
# longer than rendering it.
@cache
def _compile_template(
    name: str, text: str, filters: tuple[tuple[str, Any], ...]
) -> Template:
    from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

    # The loader is for the templates that this one imports.
    environment = Environment(
        loader=FunctionLoader(_read_template),
        autoescape=name.endswith(".html"),
        undefined=StrictUndefined,
        finalize=_protect_separators if name.endswith(".txt") else None,
    )
    environment.filters |= dict(filters)
    code = environment.compile(text, name)
    return Template.from_code(environment, code, environment.make_globals(None))


def _protect_separators(value: Any) -> Any:
    """Replace separators of cells that belong to a value."""
    if isinstance(value, str):
        return value.replace(_SEPARATOR, _SEPARATOR_IN_VALUE)
    return value


def _restore_separators(text: str) -> str:
    return text.replace(_SEPARATOR_IN_VALUE, _SEPARATOR)


def _read_template(name: str) -> str:
    """Read a template and join lines that hold only tags with the next one, so that they
    leave no empty lines."""
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return _LINE_OF_TAGS.sub(r"\1", text)


def render_sentences(
    name: str, filters: Mapping[str, Any] | None = None, /, **facts: Any
) -> dict[str, Any]:
    """Render a template of sentences (.txt).

    Returns
    -------
    dict
        Under each heading ``# name`` its paragraphs, list of str: empty lines separate
        them, other line ends do not matter. Under each heading ``## name`` the rows of a
        table, list of lists of cells: one line each, ¦ between cells.
    """
    sections: dict[str, Any] = {}
    rendered = load_template(name, filters).render(facts)
    for marks, heading, text in _SECTION.findall(rendered):
        is_table = marks == "##"
        blocks = re.split(r"\n" if is_table else _EMPTY_LINES, text)
        stripped = [block.strip(" \n") for block in blocks]
        stated = [re.sub(r"[ \n]+", " ", block) for block in stripped if block]
        if is_table:
            sections[heading] = [_split_cells(line) for line in stated]
        else:
            sections[heading] = [_restore_separators(paragraph) for paragraph in stated]
    return sections


def _split_cells(line: str) -> list[str]:
    return [_restore_separators(cell.strip(" ")) for cell in line.split(_SEPARATOR)]


def compile_document(
    path: str | Path,
    document: str,
    data: Mapping[str, Any],
    figures: Iterable[str] = (),
    origin: Origin | None = None,
    package: str = __package__,
) -> None:
    """Compile a Typst document; the PDF appears complete or not at all.

    Parameters
    ----------
    path
        Path of the PDF.
    document : str
        File name of the document.
    data
        JSON-serialisable contents of the files ``<name>.json`` that the document reads.
    figures
        Paths of PDF files; the document finds them by their names, which
        ``figures.json`` lists.
    origin
        Shown in the document's foot and its metadata: the contents of ``origin.json``,
        empty if None.
    package : str
        Package that has the document.
    """
    # Imported only here, because sentences on a terminal need no typesetter.
    import typst

    figures = [*figures]
    contents = {
        **data,
        "figures": [Path(figure).stem for figure in figures],
        "origin": "" if origin is None else origin.words,
    }
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / document
        # Documents import files of this package.
        for name in {__package__, package}:
            _copy_documents(name, folder)
        if not source.is_file():
            raise FileNotFoundError(document)
        for name, content in contents.items():
            text = json.dumps(content, allow_nan=False)
            Path(folder, f"{name}.json").write_text(text, encoding="utf-8")
        for figure in figures:
            shutil.copy(figure, folder)
        with write_atomically(path) as partial:
            typst.compile(
                source, output=Path(partial), format="pdf", root=source.parent
            )


def _copy_documents(package: str, folder: str) -> None:
    """Copy the Typst documents of a package into a folder."""
    for file in resources.files(package).iterdir():
        if file.name.endswith(".typ"):
            text = file.read_text(encoding="utf-8")
            Path(folder, file.name).write_text(text, encoding="utf-8")
