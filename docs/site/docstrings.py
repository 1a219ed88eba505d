"""Docstrings for pages on which many of them stand: numbers of references would be targets that are there twice."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

# A reference: its number in brackets, and its text on this line and on those that are indented below.
_REFERENCE = re.compile(r"^(?:\.\. )?\[(\d+)\] ([A-Z].*(?:\n {3}.*)*)", re.MULTILINE)


def with_plain_references(text: str) -> str:
    """A docstring whose references are a list and whose citations are the numbers of its items."""
    listed = _REFERENCE.sub(lambda found: f"- [{found[1]}] {' '.join(found[2].split())}", text)
    plain = re.sub(r"\[(\d+)\]_", r"[\1]", listed)
    # Determinants and absolute values are no substitutions.
    return "`".join(part if code % 2 else part.replace("|", r"\|") for code, part in enumerate(plain.split("`")))


def _of_member(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    lines[:] = with_plain_references("\n".join(lines)).split("\n")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx, before napoleon makes sections of what underlined words head."""
    app.connect("autodoc-process-docstring", _of_member, priority=100)
    return {"parallel_read_safe": True}
