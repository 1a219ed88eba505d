"""A board to print, to scale, with a line that shows if the printer changed the scale."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.errors import InputError, explain_missing_packages
from elastocal.exchange.board_pattern import CHARUCO

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elastocal.exchange.board_pattern import BoardPattern

# Width and height of sheets, mm.
PAPERS_MM = {"a4": (210.0, 297.0), "letter": (215.9, 279.4)}
_MM_PER_INCH = 25.4
# Printers leave at least this margin white, mm.
_MARGIN_MM = 6.0
# Space under the board for the line and its text, mm.
_FOOT_MM = 17.0
# Length of the line that the user checks with a rule, mm.
RULER_MM = 100.0
_TICK_MM = 10.0


def draw_board(pattern: BoardPattern, paper: str) -> Figure:
    """Draw a board to scale on a sheet of paper.

    Parameters
    ----------
    pattern : the board.
    paper : a key of `PAPERS_MM`; the sheet is in landscape if the board is wider than
        high.

    Raises
    ------
    InputError
        If the board does not fit on the paper.
    """
    with explain_missing_packages():
        from matplotlib.figure import Figure
    board = pattern.make_opencv_board()
    width, height = (1e3 * side for side in pattern.size_m)
    sheet = sorted(PAPERS_MM[paper], reverse=width > height)
    space = (sheet[0] - 2 * _MARGIN_MM, sheet[1] - 2 * _MARGIN_MM - _FOOT_MM)
    if width > space[0] or height > space[1]:
        size = f"{width:g} x {height:g} mm"
        allowed = f"at most {space[0]:g} x {space[1]:g} mm on {paper}; fewer or smaller"
        raise InputError("board", "size", size, allowed)
    figure = Figure(figsize=(sheet[0] / _MM_PER_INCH, sheet[1] / _MM_PER_INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0.0, sheet[0])
    axes.set_ylim(sheet[1], 0.0)
    axes.set_axis_off()
    corner = np.array([(sheet[0] - width) / 2, _MARGIN_MM + (space[1] - height) / 2])
    if pattern.kind == CHARUCO:
        _fill_squares(axes, pattern, board, corner)
    _fill_markers(axes, board, corner)
    _draw_ruler(axes, pattern, corner[0], sheet[1] - _MARGIN_MM - _FOOT_MM / 2)
    return figure


def _fill_squares(
    axes: Axes, pattern: BoardPattern, board: Any, corner: np.ndarray
) -> None:
    """Fill the squares of the chessboard that have no marker."""
    side = 1e3 * pattern.square_m
    with_marker = set()
    for points in board.getObjPoints():
        column, row = (1e3 * points[:, :2].mean(axis=0) // side).astype(int)
        with_marker.add((int(column), int(row)))
    for column, row in np.ndindex(pattern.columns, pattern.rows):
        if (column, row) not in with_marker:
            _fill(axes, corner + side * np.array([column, row]), side, "black")


def _fill_markers(axes: Axes, board: Any, corner: np.ndarray) -> None:
    """Fill the markers: a black square with its white bits."""
    dictionary = board.getDictionary()
    bits = dictionary.markerSize + 2
    for points, number in zip(
        board.getObjPoints(), board.getIds().ravel(), strict=True
    ):
        first = corner + 1e3 * points[:, :2].min(axis=0)
        side = 1e3 * float(np.ptp(points[:, 0]))
        _fill(axes, first, side, "black")
        image = dictionary.generateImageMarker(int(number), bits)
        for row, column in np.argwhere(image > 0):
            bit = first + side / bits * np.array([column, row])
            _fill(axes, bit, side / bits, "white")


def _fill(axes: Axes, corner: np.ndarray, side: float, colour: str) -> None:
    from matplotlib.patches import Rectangle

    axes.add_patch(
        Rectangle((corner[0], corner[1]), side, side, color=colour, linewidth=0)
    )


def _draw_ruler(axes: Axes, pattern: BoardPattern, left: float, y: float) -> None:
    """Draw the line that shows the scale, with what the board is."""
    axes.plot([left, left + RULER_MM], [y, y], color="black", linewidth=0.6)
    for tick in np.arange(0.0, RULER_MM + 1.0, _TICK_MM):
        axes.plot([left + tick] * 2, [y - 1.5, y + 1.5], color="black", linewidth=0.6)
    text = (
        f"This line must be {RULER_MM:g} mm long: print at 100 %, without fitting to the"
        f" page.\n{pattern.kind}, {pattern.columns} x {pattern.rows}, squares of"
        f" {1e3 * pattern.square_m:g} mm, markers of {1e3 * pattern.marker_m:g} mm,"
        f" {pattern.dictionary}"
    )
    axes.text(left, y + 2.5, text, fontsize=7, verticalalignment="top")
