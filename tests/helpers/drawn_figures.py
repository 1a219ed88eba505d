"""What is written on a figure, whether all of it lies on the page, and files of empty figures for the reports."""

import shutil

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from elastocal.figures.style import panels


def empty_pictures(folder, names):
    """A PDF of nothing for each name; their paths."""
    paths = [f"{folder}/{name}.pdf" for name in names]
    panels(1, 1, 20)[0].savefig(paths[0])
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
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for artist in figure.findobj(Text):
        # Ticks outside the limits of an axis exist and are not drawn.
        if artist.get_text() and artist.get_visible() and not _is_hidden_tick(artist, figure):
            box = artist.get_window_extent(renderer)
            assert figure.bbox.padded(1).contains(*box.min), f"{artist.get_text()!r} is cut off"
            assert figure.bbox.padded(1).contains(*box.max), f"{artist.get_text()!r} is cut off"


def _is_hidden_tick(artist, figure):
    drawn_ticks = set()
    all_ticks = set()
    for axis in figure.axes:
        for one, limits in ((axis.xaxis, axis.get_xlim()), (axis.yaxis, axis.get_ylim())):
            for tick in [*one.get_major_ticks(), *one.get_minor_ticks()]:
                labels = {id(tick.label1), id(tick.label2)}
                all_ticks |= labels
                if min(limits) <= tick.get_loc() <= max(limits):
                    drawn_ticks |= labels
    return id(artist) in all_ticks - drawn_ticks
