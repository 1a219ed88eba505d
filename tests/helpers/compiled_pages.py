"""Pages of documents as pixels, and their margins."""

import typst
from matplotlib.image import imread

# Margins of 22 mm on a page of 210 mm; a little of it for the edges of letters.
_MARGIN = 20 / 210


def pages_of(monkeypatch):
    """The pages, as pixels too, of every document that is compiled from now on."""
    seen, compiled = [], typst.compile

    def compile_both(source, output, format, root):
        # More than one page needs a pattern to write to.
        compiled(source, output=f"{root}/page-{{0p}}.png", format="png", root=root, ppi=60)
        seen.extend(imread(file)[:, :, :3] for file in sorted(source.parent.glob("page-*.png")))
        return compiled(source, output=output, format=format, root=root)

    monkeypatch.setattr(typst, "compile", compile_both)
    return seen


def assert_within_margins(pages):
    """There are pages, something stands on each, and nothing in its margins."""
    assert pages
    for page in pages:
        margin = int(page.shape[1] * _MARGIN)
        assert (page[:, :margin] > 0.99).all() and (page[:, -margin:] > 0.99).all()
        assert (page[:, margin:-margin] < 0.5).any()
