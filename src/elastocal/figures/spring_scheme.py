"""A robot's model as a chain of blocks and springs, one for each joint and, in the extended model, for each link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Circle, FancyBboxPatch, Polygon

from elastocal.figures.scheme_sheet import (
    BLUE,
    BOLD,
    INK,
    JOINT_FACE,
    MARGIN_MM,
    ORANGE,
    RED,
    TEXT_HEIGHT_MM,
    WIDTH_MM,
    Place,
    Sheet,
    fill_rows,
    write_subscript,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.figure import Figure

    from elastocal.mechanics.robot import Robot

_THETA = r"\theta"
_LINK_FACE = "#E4E4E4"
_BLOCK_WIDTHS_MM = {"base": 11.0, "link": 11.0, "actuator": 18.0, "elastic link": 24.0, "end-effector": 17.0}
_BLOCK_GAP_MM, _LINE_MM, _BLOCK_HALF_MM = 3.0, 22.0, 3.6


@dataclass(frozen=True)
class _Block:
    kind: str
    label: str = ""


def spring_scheme(robot: Robot) -> Figure:
    """Virtual joint model of a robot as a chain of blocks (the paper's Figure 3), drawn from its chain.

    `robot`: with `links`, the extended model is drawn below the reduced one. Returns about 160 mm wide.
    """
    sheet = Sheet()
    models = [("Reduced model: a 1-DoF spring in each joint", False)]
    if robot.links:
        models.append(("Extended model: also a 6-DoF spring at the end of each link", True))
    top = 0.0
    for title, extended in models:
        sheet.text((-WIDTH_MM / 2 + MARGIN_MM, top), title, ha="left", fontproperties=BOLD)
        top = _draw_model(sheet, _blocks(robot, extended), top - 14.0) - 3.0
    bottom = _draw_legend(sheet, bool(robot.links), top)
    half = WIDTH_MM / 2 - MARGIN_MM
    return sheet.finish((-half, bottom), (half, TEXT_HEIGHT_MM / 2))


def _blocks(robot: Robot, extended: bool) -> list[_Block]:
    """Base, links and joints in the order of the chain, end-effector."""
    link = "elastic link" if extended else "link"
    blocks, names, lengths = [_Block("base", "Base")], [], 0
    for transform in robot.chain.transforms:
        if transform.kind == "T" and transform.constant != 0:
            lengths += 1
            names.append(write_subscript("l", lengths))
        elif transform.coordinate is not None:
            # All that lies between two joints is one rigid link.
            blocks += [_Block(link, ", ".join(names))] if names else []
            names, number = [], transform.coordinate + 1
            blocks.append(_Block("actuator", f"{write_subscript('q', number)} + {write_subscript(_THETA, number)}"))
    blocks += [_Block(link, ", ".join(names))] if names else []
    return [*blocks, _Block("end-effector", "End-\neffector")]


def _draw_model(sheet: Sheet, blocks: Sequence[_Block], top: float) -> float:
    """Blocks from left to right, in as many lines as they need; returns the height below them."""
    widths = [_BLOCK_WIDTHS_MM[block.kind] for block in blocks]
    rows, previous = _even_rows(widths), None
    left = -max(sum(widths[i] + _BLOCK_GAP_MM for i in row) for row in rows) / 2
    for row in rows:
        x = left
        if previous is not None:
            _draw_return(sheet, previous, np.array([x, top]))
        for i in row:
            _draw_block(sheet, blocks[i], x, top)
            x += widths[i]
            if i != row[-1]:
                sheet.line([(x, top), (x + _BLOCK_GAP_MM, top)], lw=1.2)
            x += _BLOCK_GAP_MM
        previous = np.array([x - _BLOCK_GAP_MM, top])
        top -= _LINE_MM
    return top + _LINE_MM - 12.0


def _even_rows(widths: Sequence[float]) -> list[list[int]]:
    """As few rows as possible, the longest of them as short as possible."""
    widest = WIDTH_MM - 2 * MARGIN_MM - 8.0
    rows = fill_rows(widths, widest, _BLOCK_GAP_MM)
    for limit in np.arange(widest, max(widths), -1.0):
        shorter = fill_rows(widths, limit, _BLOCK_GAP_MM)
        if len(shorter) > len(rows):
            break
        rows = shorter
    return rows


def _draw_return(sheet: Sheet, end: np.ndarray, start: np.ndarray) -> None:
    """From the end of a line of blocks to the start of the next."""
    right, left, between = end[0] + 3.0, start[0] - 3.0, (end[1] + start[1]) / 2
    corners: list[Place] = [end, (right, end[1]), (right, between), (left, between), (left, start[1]), start]
    sheet.line(corners, lw=1.2, solid_joinstyle="round")


def _draw_block(sheet: Sheet, block: _Block, x: float, y: float) -> None:
    width = _BLOCK_WIDTHS_MM[block.kind]
    if block.kind == "base":
        _draw_box(sheet, x, width, y, "white")
        sheet.text((x + width / 2, y), block.label)
        for step in np.arange(x + 1.5, x + width + 0.1, 2.0):
            sheet.line([(step, y - _BLOCK_HALF_MM), (step - 1.6, y - _BLOCK_HALF_MM - 1.8)], lw=0.7)
    elif block.kind == "end-effector":
        _draw_box(sheet, x, width, y, "white", _BLOCK_HALF_MM + 1.0)
        sheet.text((x + width / 2, y), block.label, linespacing=1.0)
    elif block.kind == "actuator":
        _draw_actuator(sheet, x, y)
        _draw_spring(sheet, x + 8.0, x + width, y, ORANGE)
        sheet.text((x + width / 2, y + 6.4), block.label)
    else:
        _draw_box(sheet, x, _BLOCK_WIDTHS_MM["link"], y, _LINK_FACE)
        sheet.text((x + _BLOCK_WIDTHS_MM["link"] / 2, y), "Link")
        sheet.text((x + _BLOCK_WIDTHS_MM["link"] / 2, y - 6.2), block.label)
        if block.kind == "elastic link":
            _draw_six_springs(sheet, x + _BLOCK_WIDTHS_MM["link"], x + width, y)


def _draw_box(sheet: Sheet, x: float, width: float, y: float, face: str, half: float = _BLOCK_HALF_MM) -> None:
    corners = [(x, y - half), (x + width, y - half), (x + width, y + half), (x, y + half)]
    sheet.axes.add_patch(Polygon(corners, fc=face, ec=INK, lw=1.0, zorder=3))


def _draw_actuator(sheet: Sheet, x: float, y: float) -> None:
    sheet.axes.add_patch(Circle((x + 4.0, y), 4.0, fc=JOINT_FACE, ec=BLUE, lw=1.3, zorder=3))
    sheet.text((x + 4.0, y), "Ac")


def _draw_spring(sheet: Sheet, start: float, end: float, y: float, colour: str) -> None:
    steps = np.linspace(start + 1.2, end - 1.2, 9)
    heights = y + 2.2 * np.array([0, 1, -1, 1, -1, 1, -1, 1, 0])
    path = [(start, y), *zip(steps, heights, strict=True), (end, y)]
    sheet.line(path, lw=1.4, color=colour, solid_joinstyle="round", zorder=3)


def _draw_six_springs(sheet: Sheet, start: float, end: float, y: float) -> None:
    """One spring in a frame that says it stands for six."""
    start += 1.5
    sheet.line([(start - 1.5, y), (start, y)], lw=1.2)
    box = FancyBboxPatch((start, y - _BLOCK_HALF_MM), end - start, 2 * _BLOCK_HALF_MM, boxstyle="round,pad=0,rounding_size=1.2")
    box.set(fc="#FBE9DD", ec=RED, lw=1.0, zorder=2.5)
    sheet.axes.add_patch(box)
    _draw_spring(sheet, start, end, y, RED)
    sheet.text(((start + end) / 2, y + 6.4), "6D")


def _draw_legend(sheet: Sheet, extended: bool, top: float) -> float:
    half = _BLOCK_WIDTHS_MM["link"] / 2

    def link(place: np.ndarray) -> None:
        _draw_box(sheet, place[0] - half, 2 * half, place[1], _LINK_FACE)
        sheet.text(place, "Link")

    entries: list[tuple[Callable[[np.ndarray], Any], float, str]] = [
        (lambda p: _draw_actuator(sheet, p[0] - 4.0, p[1]), 8.0, "actuated joint"),
        (lambda p: _draw_spring(sheet, p[0] - 5.0, p[0] + 5.0, p[1], ORANGE), 10.0, "1-DoF spring"),
        (link, 2 * half, "rigid link"),
    ]
    if extended:
        entries.append((lambda p: _draw_six_springs(sheet, p[0] - 7.0, p[0] + 5.5, p[1]), 12.5, "6-DoF spring"))
    return sheet.legend(entries, 0.0, top - 6.0)
