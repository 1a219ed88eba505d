"""What is written on a figure, whether all of it lies on the page, and files of empty
figures for the reports."""

import shutil

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from elastocal.figures.style import create_panels


def empty_pictures(folder, names):
    """A PDF of nothing for each name; their paths."""
    paths = [f"{folder}/{name}.pdf" for name in names]
    create_panels(1, 1, 20)[0].savefig(paths[0])
    for path in paths[1:]:
        shutil.copy(paths[0], path)
    return paths


def texts(figure):
    return [artist.get_text() for artist in figure.findobj(Text) if artist.get_text()]


def texts_in_axes(figure):
    return [text.get_text() for axis in figure.axes for text in axis.texts]


def row_labels(axis):
    return [label.get_text() for label in axis.get_yticklabels()]


def legend_entries(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def assert_nothing_cut_off(figure):
    """Nothing that is drawn lies outside of the page, but for a point."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    drawn = figure.get_tightbbox(renderer).padded(-1 / 72)
    page = figure.bbox_inches
    assert page.contains(*drawn.min) and page.contains(*drawn.max), (drawn, page)
