"""Texts of a figure, the check that all of it is on the page, and files of empty
figures for reports."""

import shutil

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from elastocal.figures.style import create_panels


def empty_pictures(folder, names):
    """Write an empty PDF for each name, and return their paths."""
    paths = [f"{folder}/{name}.pdf" for name in names]
    create_panels(1, 1, 20)[0].savefig(paths[0])
    for path in paths[1:]:
        shutil.copy(paths[0], path)
    return paths


def texts(figure):
    """Return all texts of a figure."""
    return [artist.get_text() for artist in figure.findobj(Text) if artist.get_text()]


def texts_in_axes(figure):
    """Return the texts that are drawn in the axes of a figure."""
    return [text.get_text() for axis in figure.axes for text in axis.texts]


def row_labels(axis):
    """Return the labels of the y axis."""
    return [label.get_text() for label in axis.get_yticklabels()]


def legend_entries(figure):
    """Return the entries of all legends of a figure."""
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def assert_nothing_cut_off(figure):
    """Check that everything is drawn on the page, with a tolerance of one point."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    drawn = figure.get_tightbbox(renderer).padded(-1 / 72)
    page = figure.bbox_inches
    assert page.contains(*drawn.min), (drawn, page)
    assert page.contains(*drawn.max), (drawn, page)
