"""What pages need of Sphinx beside its own: plain references, formulas that browsers
draw, and a page for everyone.

References of docstrings are a list, since many docstrings stand on a page and numbers
would be targets that are there twice. Formulas are MathML: no script runs and no font
is fetched. For readers with a keyboard or a screen reader headings of the contents have
a level, long code gets the focus, landmarks have names, and a figure that is too small
leads to itself alone.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst
from sphinx_gallery.sorting import ExplicitOrder

from elastocal.effects.catalogue import list_effects

if TYPE_CHECKING:
    from sphinx.application import Sphinx
    from sphinx.writers.html5 import HTML5Translator

# A reference: its number in brackets, and its text on this line and on those that are
# indented below.
_REFERENCE = re.compile(r"^(?:\.\. )?\[(\d+)\] ([A-Z].*(?:\n {3}.*)*)", re.MULTILINE)
# Sphinx and furo write the first of each pair.
_MENDED = (
    ('role="heading"', 'role="heading" aria-level="2"'),
    ("<pre>", '<pre tabindex="0">'),
)
# Landmarks of furo without a name of their own: the pages of the site, and the headings
# of this page.
_NAMED = {"sidebar-drawer": "Pages", "toc-drawer": "On this page"}
# Examples in the order of the gallery.
_EXAMPLES = (
    "first_calibration.py",
    "what_a_robot_lacks.py",
    "no_tracker.py",
    "plan_and_correct.py",
    "own_effect.py",
    "mujoco_closed_loop.py",
    "figure_5.py",
)
# A figure, with the link that those of the catalogue have already.
_FIGURE = re.compile(r'(<a [^>]*>\s*)?<img [^>]*?src="([^"]+)"[^>]*>')


def with_plain_references(text: str) -> str:
    """A docstring whose references are a list and whose citations are the numbers of
    its items."""
    listed = _REFERENCE.sub(
        lambda found: f"- [{found[1]}] {' '.join(found[2].split())}", text
    )
    plain = re.sub(r"\[(\d+)\]_", r"[\1]", listed)
    # Determinants and absolute values are no substitutions.
    return "`".join(
        span if code % 2 else span.replace("|", r"\|")
        for code, span in enumerate(plain.split("`"))
    )


def _of_member(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    lines[:] = with_plain_references("\n".join(lines)).split("\n")


def _in_line(page: HTML5Translator, node: nodes.math) -> None:
    page.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _displayed(page: HTML5Translator, node: nodes.math_block) -> None:
    # One that is wider than a phone is moved sideways alone.
    page.body.append(
        f'<div class="formula">{tex2mathml(node.astext(), as_block=True)}</div>'
    )
    raise nodes.SkipNode


def _mend(
    app: Sphinx,
    pagename: str,
    templatename: str,
    context: dict[str, Any],
    doctree: object,
) -> None:
    for key in ("body", "furo_navigation_tree", "toctree"):
        if isinstance(context.get(key), str):
            for wrong, right in _MENDED:
                context[key] = context[key].replace(wrong, right)
    if isinstance(context.get("body"), str):
        context["body"] = _FIGURE.sub(
            lambda f: f[0] if f[1] else f'<a href="{f[2]}">{f[0]}</a>', context["body"]
        )


def _name_landmarks(app: Sphinx, exception: Exception | None) -> None:
    for page in Path(app.outdir).rglob("*.html") if exception is None else ():
        text = page.read_text(encoding="utf-8")
        for tag, name in _NAMED.items():
            text = text.replace(
                f'<aside class="{tag}">', f'<aside class="{tag}" aria-label="{name}">'
            )
        page.write_text(text, encoding="utf-8")


def scrape_figures(
    block: object, block_vars: dict[str, Any], gallery_conf: dict[str, Any]
) -> str:
    """Save each figure that an example has given a name, once."""
    variables = block_vars["example_globals"]
    saved = variables.setdefault("__saved_figures__", [])
    paths = []
    for value in [*variables.values()]:
        if isinstance(value, Figure) and not any(value is old for old in saved):
            saved.append(value)
            paths.append(str(block_vars["image_path_iterator"].next()))
            value.savefig(paths[-1], dpi=150)
    return figure_rst(paths, gallery_conf["src_dir"])


def forget_plugins(gallery_conf: dict[str, Any], example: str) -> None:
    """Make the catalogue look for plug-ins again, which one example installs and the
    others lack; close figures."""
    list_effects.cache_clear()
    plt.close("all")


class ExampleOrder(ExplicitOrder):
    """Orders examples as people need them."""

    def __init__(self, source: str) -> None:
        super().__init__(_EXAMPLES)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register with Sphinx: before napoleon makes sections of docstrings, and after
    furo has made its contents."""
    app.connect("autodoc-process-docstring", _of_member, priority=100)
    app.connect("html-page-context", _mend, priority=900)
    app.connect("build-finished", _name_landmarks)
    app.add_html_math_renderer("mathml", (_in_line, None), (_displayed, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
