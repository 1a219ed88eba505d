"""A robot's kinematic scheme: links, joints, measuring points, and their names."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Circle, Polygon

from elastocal.figures.scheme_layout import DEPTH_RATIO, PARALLEL, Joint, Point, Segment, lay_out, project_on_paper, view_of
from elastocal.figures.scheme_sheet import (
    BLUE,
    BOLD,
    GREEN,
    INK,
    JOINT_FACE,
    ORANGE,
    PINK,
    RED,
    SKY,
    SYMBOL_RADIUS_MM,
    TEXT_HEIGHT_MM,
    Sheet,
    write_subscript,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from matplotlib.figure import Figure

    from elastocal.mechanics.robot import Robot

_GREY = "#555555"
_POINT_COLOURS = (ORANGE, GREEN, PINK, RED, SKY, BLUE)
_POINT_MARKERS = "sDo^vP"
_HALF_LENGTH_MM, _HALF_WIDTH_MM = 4.2, 2.6
# A link without a length, which only keeps joints apart.
_SEPARATOR = {"lw": 1.2, "ls": (0, (3, 2)), "color": _GREY}


def kinematic_scheme(robot: Robot) -> Figure:
    """Equivalent kinematic scheme of a serial robot (the paper's Figure 2), drawn from its chain.

    `robot`: any chain of revolute joints about x, y and z. Returns about 160 mm wide. Artists have a gid: ``joint-1``,
    ``length-1``, ``point-NAME``, ``point-NAME-box``.

    A joint that turns about its own link is drawn on that link instead of at its end: moved along its axis, it is the same
    joint. So the three joints of a spherical wrist can be seen apart.
    """
    items, depth = lay_out(robot.chain)
    segments = [item for item in items if isinstance(item, Segment)]
    joints = [item for item in items if isinstance(item, Joint)]
    points = [item for item in items if isinstance(item, Point)]
    sheet = Sheet()
    _draw_base(sheet, any(abs(s.direction[2]) > 1 - PARALLEL for s in segments), view_of(robot.chain), depth)
    for segment in segments:
        _draw_segment(sheet, segment)
    for joint in joints:
        _draw_joint(sheet, joint.place, None if joint.across else project_on_paper(joint.axis, depth))
    _draw_points(sheet, points)
    _draw_labels(sheet, segments, joints, points)
    low, high = sheet.taken[:, :2].min(axis=0), sheet.taken[:, 2:].max(axis=0)
    top = high[1] + 7.0
    low[1] = _draw_legend(sheet, segments, joints, points, (low + high)[0] / 2, low[1] - 7.0)
    sheet.text(((low + high)[0] / 2, top), robot.name, fontproperties=BOLD)
    return sheet.finish(low, (high[0], top + TEXT_HEIGHT_MM / 2))


def _draw_base(sheet: Sheet, oblique: bool, view: np.ndarray, depth: np.ndarray) -> None:
    """Ground under the origin, and the base's axes beside it, where the first link does not hide them."""
    half, drop = 9.0, 2.6
    sheet.line([(-half, 0), (half, 0)], lw=1.6)
    for x in np.arange(-half + 1.0, half + 0.1, 2.0):
        sheet.line([(x, 0), (x - drop, -drop)], lw=0.7)
    sheet.take(np.array([-half - 1.0, -drop / 2]), np.array([half, -drop / 2]), drop / 2 + 0.5)
    origin, length = np.array([-27.0, 0.0]), 9.0
    right, up, into = np.array([length, 0.0]), np.array([0.0, length]), 0.8 * length * depth / DEPTH_RATIO
    for arrow, row in zip([right, up, into] if oblique else [right, up], view, strict=False):
        axis = int(np.argmax(np.abs(row)))
        # The view from the front has -x into the paper: x itself then comes out of it.
        tip = origin + arrow * row[axis]
        style = {"arrowstyle": "-|>", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
        sheet.axes.annotate("", (tip[0], tip[1]), (origin[0], origin[1]), arrowprops=style)
        place = tip + (tip - origin) / np.linalg.norm(tip - origin) * 2.2
        sheet.text(place, f"${'xyz'[axis]}$")
        sheet.take(origin, place, 1.8)
    sheet.axes.add_patch(Circle((origin[0], origin[1]), 0.6, fc=INK, ec="none", zorder=3))
    caption = origin + np.array([length / 2 - 1.0, -4.5 if not oblique or view[2].sum() > 0 else -10.0])
    sheet.text(caption, "base frame")
    sheet.take(caption - [9.0, 0], caption + np.array([9.0, 0]), TEXT_HEIGHT_MM / 2)


def _draw_segment(sheet: Sheet, segment: Segment) -> None:
    style = {"lw": 3.0, "color": _GREY} if segment.length_m else _SEPARATOR
    sheet.line([segment.start, segment.end], zorder=2, **style)
    sheet.take(segment.start, segment.end, 0.8)


def _draw_joint(sheet: Sheet, place: np.ndarray, axis: np.ndarray | None) -> None:
    """A circle where the axis points into the paper (`axis` None), else a rectangle along the axis."""
    if axis is None:
        sheet.axes.add_patch(Circle((place[0], place[1]), SYMBOL_RADIUS_MM, fc=JOINT_FACE, ec=BLUE, lw=1.3, zorder=4))
        sheet.axes.add_patch(Circle((place[0], place[1]), 0.6, fc=BLUE, ec="none", zorder=4))
        sheet.take(place, place, SYMBOL_RADIUS_MM)
        return
    along = axis / np.linalg.norm(axis)
    side = np.array([-along[1], along[0]])
    corners = [place + a * _HALF_LENGTH_MM * along + b * _HALF_WIDTH_MM * side for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    sheet.axes.add_patch(Polygon(corners, fc=JOINT_FACE, ec=BLUE, lw=1.3, zorder=4))
    ends = place - (_HALF_LENGTH_MM + 2.0) * along, place + (_HALF_LENGTH_MM + 2.0) * along
    sheet.line(ends, lw=0.8, color=BLUE, ls=(0, (6, 1.5, 1, 1.5)), zorder=5)
    sheet.take(place - 1.6 * along, place + 1.6 * along, _HALF_WIDTH_MM)
    sheet.take(*ends, 0.5)


def _draw_points(sheet: Sheet, points: Sequence[Point]) -> None:
    for number, point in enumerate(points):
        # Points that share a place are drawn one on the other, each smaller than the one below.
        below = sum(np.allclose(other.place, point.place) for other in points[:number])
        if not np.allclose(point.node, point.place):
            sheet.line([point.node, point.place], lw=0.9, ls=(0, (2, 1.5)), zorder=3)
            sheet.take(point.node, point.place, 0.4)
        sheet.axes.plot(*point.place, zorder=6.5, ls="none", **_point_style(number, below))
        sheet.take(point.place, point.place, 1.4)


def _point_style(number: int, smaller: int = 0) -> dict[str, Any]:
    size = max(2.0, 6.5 - 2.5 * smaller)
    colour, marker = _POINT_COLOURS[number % len(_POINT_COLOURS)], _POINT_MARKERS[number % len(_POINT_MARKERS)]
    return {"marker": marker, "ms": size, "mfc": colour, "mec": INK, "mew": 0.6}


def _draw_labels(sheet: Sheet, segments: Sequence[Segment], joints: Sequence[Joint], points: Sequence[Point]) -> None:
    middle = np.mean([s.start for s in segments] + [s.end for s in segments], axis=0)
    for joint in joints:
        away = _outward(joint.place, middle)
        reach = (SYMBOL_RADIUS_MM if joint.across else _HALF_WIDTH_MM) + 0.3
        sheet.label(write_subscript("q", joint.number), [joint.place], away, (reach, 9.0), f"joint-{joint.number}")
    for number, segment in enumerate((s for s in segments if s.label), start=1):
        anchors = _visible_places(segment)
        along = (segment.end - segment.start) / np.linalg.norm(segment.end - segment.start)
        side = np.array([-along[1], along[0]])
        away = side * (1.0 if side @ (anchors[0] - middle) >= 0 else -1.0)
        sheet.label(segment.label, anchors, away, (1.2, 6.0), f"length-{number}")
    for number, point in enumerate(points):
        colour = _POINT_COLOURS[number % len(_POINT_COLOURS)]
        sheet.label(point.name, [point.place], _outward(point.place, middle), (8.0, 0.0), f"point-{point.name}", frame=colour)


def _draw_mark(sheet: Sheet, number: int, place: np.ndarray) -> None:
    sheet.axes.plot(*place, ls="none", **_point_style(number))


def _visible_places(segment: Segment) -> list[np.ndarray]:
    """Places on a link that no joint covers, those near its middle first."""
    places = [segment.start + part * (segment.end - segment.start) for part in (0.5, 0.6, 0.4, 0.7, 0.3, 0.8, 0.2)]
    covered = [any(np.linalg.norm(joint.place - place) < _HALF_LENGTH_MM for joint in segment.carried) for place in places]
    return [place for place, hidden in zip(places, covered, strict=True) if not hidden] or places


def _outward(place: np.ndarray, middle: np.ndarray) -> np.ndarray:
    distance = np.linalg.norm(place - middle)
    return (place - middle) / distance if distance > 0 else np.array([0.0, 1.0])


def _draw_legend(
    sheet: Sheet, segments: Iterable[Segment], joints: Iterable[Joint], points: Sequence[Point], middle: float, top: float
) -> float:
    """Symbols and what they mean, below the drawing; returns where it ends."""
    entries: list[tuple[Callable[[np.ndarray], Any], float, str]] = []
    if any(not joint.across for joint in joints):
        entries.append((lambda p: _draw_joint(sheet, p, np.array([1.0, 0.0])), 13.0, "joint, axis in plane"))
    if any(joint.across for joint in joints):
        entries.append((lambda p: _draw_joint(sheet, p, None), 8.0, "joint, axis normal to plane"))
    for number, point in enumerate(points):
        name = f"measuring point {point.name}" if number == 0 else point.name
        entries.append((partial(_draw_mark, sheet, number), 4.0, name))
    if any(not segment.length_m for segment in segments):
        entries.append((lambda p: sheet.line([(p[0] - 4.0, p[1]), (p[0] + 4.0, p[1])], **_SEPARATOR), 9.0, "no length"))
    bottom = sheet.legend(entries, middle, top)
    note = "Lengths are not to scale. A joint may be shown moved along its axis."
    sheet.text((middle, bottom - 3.5), note, color=_GREY)
    return bottom - 3.5 - TEXT_HEIGHT_MM / 2
