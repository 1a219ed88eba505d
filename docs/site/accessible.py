"""Pages for readers with a keyboard or a screen reader: headings of the contents have a level, long code gets the focus.

Landmarks have names, and a figure that is too small leads to itself alone.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

# Sphinx and furo write the first of each pair.
_MENDED = (('role="heading"', 'role="heading" aria-level="2"'), ("<pre>", '<pre tabindex="0">'))
# Landmarks of furo without a name of their own: the pages of the site, and the headings of this page.
_NAMED = {"sidebar-drawer": "Pages", "toc-drawer": "On this page"}
# A figure, with the link that those of the gallery have already.
_FIGURE = re.compile(r'(<a [^>]*>\s*)?<img [^>]*?src="([^"]+)"[^>]*>')
_PARTS = ("body", "furo_navigation_tree", "toctree")


def _mend(app: Sphinx, pagename: str, templatename: str, context: dict[str, Any], doctree: object) -> None:
    for part in _PARTS:
        if isinstance(context.get(part), str):
            for wrong, right in _MENDED:
                context[part] = context[part].replace(wrong, right)
    if isinstance(context.get("body"), str):
        context["body"] = _FIGURE.sub(_as_link, context["body"])


def _as_link(figure: re.Match[str]) -> str:
    return figure[0] if figure[1] else f'<a href="{figure[2]}">{figure[0]}</a>'


def _name_landmarks(app: Sphinx, exception: Exception | None) -> None:
    for page in Path(app.outdir).rglob("*.html") if exception is None else ():
        text = page.read_text(encoding="utf-8")
        for part, name in _NAMED.items():
            text = text.replace(f'<aside class="{part}">', f'<aside class="{part}" aria-label="{name}">')
        page.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx, after furo has made its contents."""
    app.connect("html-page-context", _mend, priority=900)
    app.connect("build-finished", _name_landmarks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
