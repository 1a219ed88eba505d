"""The sheet of paper that both schemes of a robot are drawn on: strokes, texts, labels that find room, the legend."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import FancyBboxPatch
from matplotlib.text import Text
from matplotlib.textpath import TextPath

from elastocal.figures.style import PALETTE

WIDTH_MM = 160.0
MARGIN_MM = 3.0
_MM_PER_INCH = 25.4
_FONT = FontProperties(family="DejaVu Sans", size=9)
BOLD = FontProperties(family="DejaVu Sans", size=9, weight="bold")
TEXT_HEIGHT_MM = 3.6
LEGEND_ROW_MM, _LEGEND_HALF_MM, _LEGEND_GAP_MM = 12.0, 4.0, 5.0
# What a label names reaches about this far from the label's anchor.
SYMBOL_RADIUS_MM = 3.4

INK = "#222222"
BLUE, RED, GREEN, PINK, ORANGE, SKY = PALETTE[:6]
JOINT_FACE = "#D6E8F5"

# Right and up, in millimetres: a pair or an ndarray (2,).
Place = tuple[float, float] | np.ndarray


class Sheet:
    """A sheet of paper in millimetres that knows which of its places are taken, to find room for labels."""

    def __init__(self) -> None:
        self.figure = Figure()
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set_axis_off()
        self.taken = np.empty((0, 4))

    def take(self, start: np.ndarray, end: np.ndarray, half_width: float) -> None:
        """Keep labels off the stroke from `start` to `end`, (2,) each."""
        self.taken = np.vstack([self.taken, _boxes_along(start, end, half_width)])

    def line(self, points: Sequence[Place], **style: Any) -> None:
        """A line through points."""
        self.axes.plot(*np.array(points).T, **{"color": INK, "lw": 0.8, "solid_capstyle": "round", **style})

    def text(self, place: Place, text: str, **style: Any) -> Text:
        """A text, centred on its place by default."""
        usual: dict[str, Any] = {"ha": "center", "va": "center", "fontproperties": _FONT, "color": INK, "zorder": 8}
        return self.axes.text(place[0], place[1], text, **usual | style)

    def label(
        self,
        text: str,
        anchors: Sequence[np.ndarray],
        away: np.ndarray,
        reach: tuple[float, float],
        gid: str,
        frame: str | None = None,
    ) -> None:
        """Put a label at the nearest free place around one of its anchors, preferably in the direction `away`.

        `reach` holds the smallest distance from the anchor and that from which on a thin leader shows what is meant.
        """
        size = np.array([_text_width(text), TEXT_HEIGHT_MM]) + (1.8 if frame else (2.8, 1.0))
        anchor, centre, leader = self._free_place(anchors, size, away, reach)
        box = np.concatenate([centre - size / 2, centre + size / 2])
        self.taken = np.vstack([self.taken, box])
        if leader is not None:
            self.line([anchor, leader], lw=0.7, color=frame or INK, zorder=6)
            self.take(anchor, leader, 0.2)
        if frame:
            corner, extent = box[:2] + 0.3, size - 0.6
            rounded = FancyBboxPatch((corner[0], corner[1]), extent[0], extent[1], boxstyle="round,pad=0,rounding_size=0.8")
            rounded.set(fc="white", ec=frame, lw=1.0, zorder=7, gid=f"{gid}-box")
            self.axes.add_patch(rounded)
        self.text(centre, text, gid=gid)

    def _free_place(
        self, anchors: Sequence[np.ndarray], size: np.ndarray, away: np.ndarray, reach: tuple[float, float]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        choices: list[tuple[float, int, np.ndarray, np.ndarray, float]] = []
        for preference, anchor in enumerate(anchors):
            for distance in np.arange(reach[0], reach[0] + 30.0, 1.0):
                for angle in np.radians(np.arange(0, 360, 15)):
                    unit = np.array([np.cos(angle), np.sin(angle)])
                    cost = distance + 2.5 * (1.0 - unit @ away) + 0.7 * preference
                    choices.append((round(float(cost), 6), len(choices), anchor, unit, distance))
        choices.sort(key=lambda choice: choice[:2])
        for _, _, anchor, unit, distance in choices:
            near = anchor + distance * unit
            # The box touches `near` with the middle of that side, or the corner, which faces the anchor.
            toward = np.where(np.abs(unit) > 0.3, np.sign(unit), 0.0)
            centre = near + toward * size / 2
            leader = near if distance >= reach[1] else None
            if self._is_free(centre - size / 2, centre + size / 2) and self._leads_freely(anchor, near):
                return anchor, centre, leader
        anchor, unit, distance = choices[0][2:]
        return anchor, anchor + unit * (distance + size / 2), None

    def _is_free(self, low: np.ndarray, high: np.ndarray) -> bool:
        clear = (self.taken[:, :2] >= high) | (self.taken[:, 2:] <= low)
        return bool(clear.any(axis=1).all())

    def _leads_freely(self, anchor: np.ndarray, end: np.ndarray) -> bool:
        # With or without a leader, nothing may come between a label and what it names, which itself lies near the anchor.
        length = np.linalg.norm(end - anchor)
        start = anchor + (end - anchor) * min(1.0, (SYMBOL_RADIUS_MM + 1.5) / length)
        return all(self._is_free(box[:2], box[2:]) for box in _boxes_along(start, end, 0.2))

    def legend(self, entries: Sequence[tuple[Callable[[np.ndarray], Any], float, str]], middle: float, top: float) -> float:
        """Rows of (draw, width of the symbol, text), centred, as many in a row as fit; returns where they end."""
        widths = [symbol + 1.5 + _text_width(text) for _, symbol, text in entries]
        for row in fill_rows(widths, WIDTH_MM - 2 * MARGIN_MM, gap=_LEGEND_GAP_MM):
            x = middle - (sum(widths[i] for i in row) + _LEGEND_GAP_MM * (len(row) - 1)) / 2
            for i in row:
                draw, symbol, text = entries[i]
                draw(np.array([x + symbol / 2, top]))
                self.text((x + symbol + 1.5, top), text, ha="left")
                x += widths[i] + _LEGEND_GAP_MM
            top -= LEGEND_ROW_MM
        return top + LEGEND_ROW_MM - _LEGEND_HALF_MM

    def finish(self, low: Place, high: Place) -> Figure:
        """Cut the sheet to what lies between two corners, centred in the usual width."""
        low, high = np.array(low) - MARGIN_MM, np.array(high) + MARGIN_MM
        spare = max(0.0, WIDTH_MM - (high - low)[0]) / 2
        low[0], high[0] = low[0] - spare, high[0] + spare
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        self.figure.set_size_inches(*((high - low) / _MM_PER_INCH))
        return self.figure


def write_subscript(letter: str, number: int) -> str:
    """A letter with a number below, as mathematics."""
    return f"${letter}_{{{number}}}$"


def fill_rows(widths: Sequence[float], limit: float, gap: float) -> list[list[int]]:
    """Indices of widths that fill rows one after another."""
    rows: list[list[int]] = [[]]
    used = 0.0
    for index, width in enumerate(widths):
        if rows[-1] and used + gap + width > limit:
            rows.append([])
        used = used + gap + width if rows[-1] else width
        rows[-1].append(index)
    return rows


def _text_width(text: str) -> float:
    return TextPath((0, 0), text, prop=_FONT).get_extents().width * _MM_PER_INCH / 72


def _boxes_along(start: np.ndarray, end: np.ndarray, half_width: float) -> np.ndarray:
    steps = max(2, int(np.ceil(np.linalg.norm(end - start))) + 1)
    centres = start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)
    return np.hstack([centres - half_width, centres + half_width])
