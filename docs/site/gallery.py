"""The page of all figures: a thumbnail of each, with what it shows and a link to the page on which it stands."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.effects.catalogue import effects

if TYPE_CHECKING:
    from collections.abc import Iterable

REPOSITORY = Path(__file__).resolve().parents[2]
PICTURE = re.compile(r"!\[([^]]+)\]\(([^)]+\.png)\)")

HEAD = """Gallery
=======

Each figure leads to the page that explains it. ``make pictures`` draws those of the study and of the loop anew.

"""


def page(pages: Iterable[Path]) -> str:
    """The page, in reStructuredText: figures of the pages, then what each effect of the catalogue does."""
    figures: dict[Path, str] = {}
    for place in pages:
        for words, link in PICTURE.findall((REPOSITORY / place).read_text(encoding="utf-8")):
            picture = (REPOSITORY / place.parent / link).resolve().relative_to(REPOSITORY)
            target = f"../{place.with_suffix('.html').as_posix()}"
            figures.setdefault(picture, thumbnail(f"/{picture.as_posix()}", words, target))
    found = [
        thumbnail(f"/signatures/{name}.svg", effect.words, f"effects.html#{anchor(name)}") for name, effect in effects().items()
    ]
    return f"{HEAD}Figures\n-------\n\n{thumbnails(figures.values())}Effects\n-------\n\n{thumbnails(found)}"


def thumbnails(found: Iterable[str]) -> str:
    """A grid of thumbnails."""
    body = "".join(found).replace("\n", "\n   ").rstrip()
    return f".. container:: gallery\n\n   {body}\n\n"


def thumbnail(picture: str, words: str, target: str) -> str:
    """A picture with a line below it that leads somewhere."""
    return f".. figure:: {picture}\n   :alt: {words}\n   :target: {target}\n\n   {words}\n\n"


def anchor(name: str) -> str:
    """The anchor that Sphinx makes of the label of an effect."""
    return name.replace("_", "-")
