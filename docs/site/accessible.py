"""Pages for readers with a keyboard or a screen reader: headings of the contents have a level, long code gets the focus."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

# Sphinx and furo write the first of each pair.
_MENDED = (('role="heading"', 'role="heading" aria-level="2"'), ("<pre>", '<pre tabindex="0">'))
_PARTS = ("body", "furo_navigation_tree", "toctree")


def _mend(app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: object) -> None:
    for part in _PARTS:
        if isinstance(context.get(part), str):
            for wrong, right in _MENDED:
                context[part] = context[part].replace(wrong, right)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx, after furo has made its contents."""
    app.connect("html-page-context", _mend, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
