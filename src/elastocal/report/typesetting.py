"""Templates and the data that they show: sentences and pages by Jinja, documents by
Typst."""

from __future__ import annotations

import json
import re
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

    from jinja2 import Template

    from elastocal.io.origin import Origin


def load_template(name: str, filters: Mapping[str, Any] | None = None) -> Template:
    """A template of this package with filters of its own, such as `words.FILTERS`;
    pages (.html) escape what they show."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    def source(name: str) -> str:
        # A line of tags alone leaves no line; one that has text, too, ends where it
        # ends.
        text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
        return re.sub(
            r"^[ \t]*((?:\{%(?:(?!%\}).)*%\})+)[ \t]*\n",
            r"\1",
            text,
            flags=re.MULTILINE,
        )

    environment = Environment(
        loader=FunctionLoader(source),
        autoescape=name.endswith(".html"),
        undefined=StrictUndefined,
    )
    environment.filters |= filters or {}
    return environment.get_template(name)


def render_sentences(
    name: str, filters: Mapping[str, Any] | None = None, /, **facts: Any
) -> dict[str, Any]:
    """What a template of sentences (.txt) says.

    Returns under each heading ``# name`` its paragraphs, list of str: empty lines stand
    between them, where other lines end does not matter; under each heading ``## name``
    the rows of a table, list of lists of cells: a line each, ¦ between cells.
    """
    found: dict[str, Any] = {}
    for marks, head, text in re.findall(
        r"^(##?) (\w+)\n(.*?)(?=^##? \w+\n|\Z)",
        load_template(name, filters).render(facts),
        re.DOTALL | re.MULTILINE,
    ):
        parts = re.split(r"\n" if len(marks) > 1 else r"\n[ \n]*\n", text)
        stated = [
            re.sub(r"[ \n]+", " ", part.strip(" \n"))
            for part in parts
            if part.strip(" \n")
        ]
        found[head] = (
            [[cell.strip(" ") for cell in line.split("¦")] for line in stated]
            if len(marks) > 1
            else stated
        )
    return found


def compile_document(
    path: str | Path,
    document: str,
    data: Mapping[str, Any],
    figures: Iterable[str] = (),
    origin: Origin | None = None,
    package: str = __package__,
) -> None:
    """Compile a Typst document; the PDF appears whole or not at all.

    `path`: the PDF. `document`: file name of the document. `data`: JSON-serialisable
    contents of the files ``<name>.json`` that the document reads. `figures`: PDF files;
    the document finds them by their names, which ``figures.json`` lists. `origin`: what
    the document shows in its foot and has in its metadata: the contents of
    ``origin.json``, empty without. `package`: has the document.
    """
    figures = [*figures]
    words = "" if origin is None else origin.words
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / document
        # A document imports what it shares with the others, which stands here.
        beside = (
            each
            for name in {__package__, package}
            for each in resources.files(name).iterdir()
        )
        for each in beside:
            if each.name.endswith(".typ"):
                Path(folder, each.name).write_text(
                    each.read_text(encoding="utf-8"), encoding="utf-8"
                )
        if not source.is_file():
            raise FileNotFoundError(document)
        for name, contents in {
            **data,
            "figures": [Path(each).stem for each in figures],
            "origin": words,
        }.items():
            (Path(folder) / f"{name}.json").write_text(
                json.dumps(contents, allow_nan=False), encoding="utf-8"
            )
        for figure in figures:
            shutil.copy(figure, folder)
        with atomic_write(path) as partial:
            typst.compile(
                source, output=Path(partial), format="pdf", root=source.parent
            )
