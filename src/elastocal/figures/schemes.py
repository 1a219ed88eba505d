"""Schemes drawn from a robot's chain: links, joints and measuring points (the paper's
Figure 2), and springs (Figure 3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.path import Path
from matplotlib.textpath import TextPath
from scipy.spatial.transform import Rotation

from elastocal.figures.style import PALETTE, styled
from elastocal.mechanics.chain import Chain
from elastocal.mechanics.robot import Robot

_WIDTH_MM = 160.0
_ROW_MM = 124.0
_POINTS_PER_MM = 72 / 25.4
_NOWHERE = ((), ())
_INK = "#222222"
_GREY = "#555555"
_BLUE = PALETTE[0]
_FACE = "#D6E8F5"
_FONT = FontProperties(family="DejaVu Sans", size=9)
_TEXT_MM = 4.2
_POINT_LOOKS = [
    (PALETTE[colour], marker)
    for colour, marker in zip((4, 2, 3, 1, 5, 0), "sDo^vP", strict=True)
]
# Base axes to (right, up, into the paper), from the side and from the front.
_VIEWS = np.array(
    [[[1.0, 0, 0], [0, 0, 1], [0, 1, 0]], [[0, 1, 0], [0, 0, 1], [-1, 0, 0]]]
)
# Directions with a larger cosine between them count as parallel.
_PARALLEL = 0.95
# The shortest link, the longest one's excess, a joint whose axis is in the paper, one
# normal to it, and all links together.
_SHORTEST_MM = 13.0
_EXCESS_MM = 18.0
_JOINT_MM = 15.0
_CIRCLE_MM = 3.2
_ARM_MM = 150.0
# What a unit into the paper becomes on it.
_DEPTH = np.array([0.53, 0.53])
_AXIS: dict[str, Any] = {
    "lw": 0.8,
    "color": _BLUE,
    "ls": (0, (6, 1.5, 1, 1.5)),
    "zorder": 5,
}
_ZIGZAG = Path(
    [
        (-5, 0),
        (-4, 0),
        *zip(np.arange(-3.5, 4), [2.2, -2.2] * 4, strict=True),
        (4, 0),
        (5, 0),
    ]
)
# Of each block of a spring scheme: width in mm, face, edge, and what is written in it.
_BLOCKS = {
    "base": (11.0, "white", _INK, "Base"),
    "link": (11.0, "#E4E4E4", _INK, "Link"),
    "actuator": (8.0, _FACE, _BLUE, "Ac"),
    "spring": (10.0, "none", PALETTE[4], ""),
    "6 springs": (12.0, "#FBE9DD", PALETTE[1], ""),
    "end-effector": (17.0, "white", _INK, "End-\neffector"),
}


@dataclass(frozen=True)
class Layout:
    """Places on paper, (2,) in mm from the base's origin.

    `links`: start, end and label, empty for what has no length. `joints`: number, place
    and direction of the axis, None normal to the paper. `points`: name, node of the
    chain, and place, elsewhere where the target has an offset.
    """

    links: list[tuple[np.ndarray, np.ndarray, str]]
    joints: list[tuple[int, np.ndarray, np.ndarray | None]]
    points: list[tuple[str, np.ndarray, np.ndarray]]


def lay_out_chain(chain: Chain) -> tuple[Layout, np.ndarray]:
    """A side view with the base's z upwards; what lies across the view recedes
    obliquely.

    Joints normal to the paper are bent so that the links run in an arch, the others
    stay at zero. Lengths are not to scale, so that 41 mm can be seen next to 1150 mm.
    Returns the layout, and base axes to (right, up, into the paper), (3, 3).
    """
    view = max(_VIEWS, key=lambda view: len(_frames(chain, view)[1]))
    frames = _bent_frames(chain, view)
    layout = Layout([], [], [])
    lengths = {
        i: t.constant
        for i, t in enumerate(chain.transforms)
        if t.kind == "T" and t.constant
    }
    steps = {
        i: np.sign(constant) * frames[i][:, chain.transforms[i].axis]
        for i, constant in lengths.items()
    }
    shares = np.abs([*lengths.values()]) / max(np.abs([*lengths.values()]), default=1.0)
    excess = np.clip(
        (_ARM_MM - _SHORTEST_MM * len(lengths)) / max(shares.sum(), 1.0),
        0.0,
        _EXCESS_MM,
    )
    here = np.zeros(2)
    last = np.array([0.0, 1.0, 0.0])

    def go(direction: np.ndarray, length_mm: float, label: str = "") -> np.ndarray:
        nonlocal here, last
        start = here
        here = here + length_mm * (direction[:2] + direction[2] * _DEPTH)
        last = direction
        layout.links.append((start, here, label))
        return start

    for index, frame in enumerate(frames):
        for point in (point for point in chain.points if point.after == index):
            away = (
                frame
                @ np.array(point.offset_m)
                / (np.linalg.norm(point.offset_m) or 1.0)
                * _JOINT_MM
            )
            layout.points.append((point.name, here, here + away[:2] + away[2] * _DEPTH))
        transform = chain.transforms[index] if index < len(chain.transforms) else None
        if index in steps:
            number = [*steps].index(index)
            value = f"{round(1000 * lengths[index], 1):g}".replace(
                "-", "\N{MINUS SIGN}"
            )
            go(
                steps[index],
                _SHORTEST_MM + excess * shares[number],
                f"$l_{{{number + 1}}}$ = {value} mm",
            )
        elif transform is not None and transform.coordinate is not None:
            axis = frame[:, transform.axis]
            if abs(axis[2]) > _PARALLEL:
                # Not on the ground, and not on another joint.
                if any(
                    np.allclose(here, other)
                    for other in [
                        np.zeros(2),
                        *(other for _, other, _ in layout.joints),
                    ]
                ):
                    go(last, _JOINT_MM)
                layout.joints.append((transform.coordinate + 1, here, None))
            else:
                # Onwards along the link before it, or along the one behind it.
                near = [last, *(step for i, step in steps.items() if i > index)][:2]
                along = next(
                    (step @ axis for step in near if abs(step @ axis) > _PARALLEL),
                    last @ axis,
                )
                start = go(-axis if along < -1e-9 else axis, _JOINT_MM)
                layout.joints.append(
                    (transform.coordinate + 1, (start + here) / 2, here - start)
                )
    return layout, view


def _frames(chain: Chain, view: np.ndarray) -> tuple[list[np.ndarray], list[int]]:
    """Axes of the moving frame before each transform and after the last, all joints at
    zero, as (right, up, into the paper).

    Also the places in the chain of the joints whose axes are normal to the paper.
    """
    frames = [view]
    normal = []
    for index, transform in enumerate(chain.transforms):
        angle = (
            transform.constant
            if transform.kind == "R" and transform.coordinate is None
            else 0.0
        )
        normal += (
            [index]
            if transform.coordinate is not None
            and abs(frames[-1][2, transform.axis]) > _PARALLEL
            else []
        )
        frames.append(
            frames[-1]
            @ Rotation.from_rotvec(angle * np.eye(3)[transform.axis]).as_matrix()
        )
    return frames, normal


def _bent_frames(chain: Chain, view: np.ndarray) -> list[np.ndarray]:
    """The same frames, with each joint normal to the paper bent for the longest link
    before the next one: an arch."""
    (frames, normal), heads = _frames(chain, view), {}
    for first, end in zip(normal, [*normal, len(frames)][1:], strict=True):
        moves = [
            (i, t)
            for i, t in enumerate(chain.transforms[:end])
            if i > first and t.kind == "T"
        ]
        longest = max(
            (t.constant * frames[i][:2, t.axis] for i, t in moves),
            key=np.linalg.norm,
            default=np.zeros(2),
        )
        if np.linalg.norm(longest) > 1e-9:
            heads[first] = np.arctan2(longest[1], longest[0])
    wanted = dict(
        zip(heads, np.radians(np.linspace(70.0, -45.0, len(heads))), strict=True)
    )
    bent = []
    turn = 0.0
    for index, frame in enumerate(frames):
        bent.append(Rotation.from_rotvec([0, 0, turn]).as_matrix() @ frame)
        turn = wanted[index] - heads[index] if index in heads else turn
    return bent


class _Sheet:
    """A sheet of paper in millimetres that knows which of its places are taken, to find
    room for labels."""

    def __init__(self, middle: np.ndarray | None = None) -> None:
        self.figure = Figure()
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set_axis_off()
        self.taken = np.empty((0, 4))
        self.middle = middle

    def line(
        self, points: Sequence[Any], half_width: float = 0.0, **style: Any
    ) -> None:
        """A line through points, which labels keep off by `half_width` where it is
        given."""
        self.axes.plot(
            *np.array(points).T,
            **{"color": _INK, "lw": 0.8, "solid_capstyle": "round", **style},
        )
        if half_width:
            start = np.array(points[0])
            end = np.array(points[-1])
            centres = start + np.linspace(0, 1, int(np.linalg.norm(end - start)) + 2)[
                :, None
            ] * (end - start)
            self.taken = np.vstack(
                [self.taken, np.hstack([centres - half_width, centres + half_width])]
            )

    def text(self, place: Any, text: str, **style: Any) -> None:
        """A text, centred on its place by default."""
        usual: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontproperties": _FONT,
            "color": _INK,
            "zorder": 8,
        }
        self.axes.text(place[0], place[1], text, **usual | style)

    def label(
        self,
        text: str,
        anchor: np.ndarray,
        along: Any,
        reach: float,
        gid: str,
        frame: str = "",
    ) -> None:
        """Put a label at the nearest free place, rather outside and across the stroke
        `along`; far ones get a leader."""
        outward = anchor - self.middle
        away = (
            outward
            if along is None
            else np.array([-along[1], along[0]])
            * np.sign(along[0] * outward[1] - along[1] * outward[0])
        )
        away = away / (np.linalg.norm(away) or 1.0)
        width = TextPath((0, 0), text, prop=_FONT).get_extents().width / _POINTS_PER_MM
        size = np.array([width, _TEXT_MM]) + (2.4 if frame else (3.0, 1.2))
        angles = np.radians(np.arange(0, 360, 15))
        choices = product(
            np.arange(reach, reach + 45.0),
            np.column_stack([np.cos(angles), np.sin(angles)]),
        )
        for distance, unit in sorted(
            choices, key=lambda choice: round(choice[0] - 3.0 * choice[1] @ away, 6)
        ):
            near = anchor + distance * unit
            # The box touches `near` with the middle of that side, or the corner, which
            # faces the anchor.
            centre = near + np.where(np.abs(unit) > 0.3, np.sign(unit), 0.0) * size / 2
            # With or without a leader, nothing may come between a label and what it
            # names, which itself lies near the anchor.
            way = anchor + np.outer(np.arange(_CIRCLE_MM + 1.5, distance), unit)
            lows = np.vstack([centre - size / 2, way - 0.4])
            highs = np.vstack([centre + size / 2, way + 0.4])
            if (
                ((self.taken[:, None, :2] >= highs) | (self.taken[:, None, 2:] <= lows))
                .any(axis=2)
                .all()
            ):
                break
        self.taken = np.vstack(
            [self.taken, [*(centre - size / 2), *(centre + size / 2)]]
        )
        if distance > reach + 3.0 or frame:
            self.line([anchor, near], 0.3, lw=0.7, color=frame or _INK, zorder=6)
        self.text(
            centre,
            text,
            gid=gid,
            bbox={"fc": "white", "ec": frame, "pad": 2.4} if frame else None,
        )

    def finish(
        self,
        legend: Sequence[tuple[Any, str]],
        title: str,
        columns: int,
        low: Any,
        high: Any,
    ) -> Figure:
        """Cut the sheet to what lies between two corners, in the middle of the usual
        width, with a legend below."""
        half = max(_WIDTH_MM, high[0] - low[0] + 6.0) / 2
        below = 12.0 + 7.0 * -(-len(legend) // columns)
        middle = (low[0] + high[0]) / 2
        height = high[1] - low[1] + 6.0 + below
        self.axes.set(
            xlim=(middle - half, middle + half),
            ylim=(low[1] - 3.0 - below, high[1] + 3.0),
        )
        self.figure.set_size_inches(2 * half / 25.4, height / 25.4)
        look: dict[str, Any] = {
            "loc": "lower center",
            "labelspacing": 1.1,
            "handleheight": 1.6,
            "handlelength": 3.6,
        }
        self.figure.legend(
            *zip(*legend, strict=True), title=title, ncols=columns, **look
        )
        return self.figure


@styled
def draw_kinematic_scheme(robot: Robot) -> Figure:
    """Equivalent kinematic scheme of a serial robot (the paper's Figure 2), about 160
    mm wide.

    A joint about its own link is moved along its axis, which leaves it the same joint:
    so those of a wrist are seen apart. Artists have a gid: ``joint-1``, ``length-1``,
    ``point-NAME``, ``point-NAME-box``.
    """
    layout, view = lay_out_chain(robot.chain)
    ends = np.array(
        [
            np.zeros(2),
            *(end for _, end, _ in layout.links),
            *(place for _, _, place in layout.points),
        ]
    )
    sheet = _Sheet(ends.mean(axis=0))
    _draw_base(sheet, view, ends[:, 0].min() - 27.0)
    for start, end, _ in layout.links:
        sheet.line([start, end], 0.9, lw=3.0, color=_GREY, zorder=2)
    for _, place, axis in layout.joints:
        if axis is None:
            sheet.line([place, place], _CIRCLE_MM, lw=0)
            sheet.axes.add_line(_mark(place, "o", 2 * _CIRCLE_MM))
            sheet.axes.add_line(_mark(place, "o", 1, _BLUE))
            continue
        along = axis / np.linalg.norm(axis)
        for half, width, colour in ((4.0, 5.2, _BLUE), (3.6, 4.4, _FACE)):
            look: dict[str, Any] = {
                "lw": width * _POINTS_PER_MM,
                "color": colour,
                "solid_capstyle": "butt",
                "zorder": 4,
            }
            sheet.line([place - half * along, place + half * along], **look)
        sheet.line([place - 6 * along, place + 6 * along], 0.5, **_AXIS)
        sheet.line([place - 2 * along, place + 2 * along], 2.6, lw=0)
    for number, place, axis in layout.joints:
        sheet.label(f"$q_{{{number}}}$", place, axis, _CIRCLE_MM, f"joint-{number}")
    legend: list[tuple[Any, str]] = [
        (
            (Patch(fc=_FACE, ec=_BLUE, lw=1.3), Line2D([], [], **_AXIS)),
            "joint, axis in plane",
        )
    ]
    legend += [
        (
            (_mark(_NOWHERE, "o", 4), _mark(_NOWHERE, "o", 1, _BLUE)),
            "joint, axis normal to plane",
        )
    ]
    for number, (name, node, place) in enumerate(layout.points):
        # Points that share a place are drawn one on the other, each smaller than the
        # one below.
        below = sum(np.allclose(other, place) for _, _, other in layout.points[:number])
        colour, marker = _POINT_LOOKS[number % len(_POINT_LOOKS)]
        sheet.line([node, place], 1.4, lw=0.9, ls=(0, (2, 1.5)), zorder=3)
        sheet.axes.add_line(
            _mark(place, marker, max(0.7, 2.3 - 0.9 * below), colour, _INK, 0.6, 6.5)
        )
        sheet.label(name, place, None, 7.0, f"point-{name}", colour)
        legend.append(
            (_mark(_NOWHERE, marker, 2.3, colour, _INK, 0.6), f"measuring point {name}")
        )
    for number, (start, end, label) in enumerate(
        (link for link in layout.links if link[2]), start=1
    ):
        sheet.label(label, (start + end) / 2, end - start, 1.0, f"length-{number}")
    low = sheet.taken[:, :2].min(axis=0)
    high = sheet.taken[:, 2:].max(axis=0) + np.array([0.0, 7.0])
    sheet.text(((low[0] + high[0]) / 2, high[1] - 2.0), robot.name, weight="bold")
    note = "Lengths are not to scale. Joints are shown moved along their axes; parts without a length have no label."
    return sheet.finish(legend, note, 3, low, high)


def _mark(
    place: Any,
    marker: Any,
    size_mm: float,
    face: str = _FACE,
    edge: str = _BLUE,
    width: float = 1.3,
    z: float = 4,
) -> Line2D:
    look: dict[str, Any] = {
        "ls": "",
        "marker": marker,
        "ms": size_mm * _POINTS_PER_MM,
        "mfc": face,
        "mec": edge,
        "mew": width,
    }
    return Line2D(*np.reshape(place, (2, -1)), zorder=z, **look)


def _draw_base(sheet: _Sheet, view: np.ndarray, left: float) -> None:
    """Ground under the origin, and the base's axes beside it."""
    sheet.line([(-9, 0), (9, 0)], 1.0, lw=1.6)
    for x in np.arange(-8.0, 9.1, 2.0):
        sheet.line([(x, 0), (x - 2.6, -2.6)], 0.5, lw=0.7)
    origin = np.array([left, 0.0])
    caption = (left + 1.0, -5.0 if view[2].sum() > 0 else -12.0)
    for direction, row in zip(
        ([9.0, 0.0], [0.0, 9.0], 9.0 * _DEPTH), view, strict=True
    ):
        axis = int(np.argmax(np.abs(row)))
        # The view from the front has -x into the paper: x itself then comes out of it.
        tip = origin + np.array(direction) * row[axis]
        sheet.axes.annotate(
            "",
            (tip[0], tip[1]),
            (left, 0.0),
            arrowprops={"arrowstyle": "-|>", "color": _INK, "shrinkA": 0, "shrinkB": 0},
        )
        name = tip + 2.4 * (tip - origin) / np.linalg.norm(tip - origin)
        sheet.line([origin, name], 2.2, lw=0)
        sheet.text(name, f"${'xyz'[axis]}$")
    sheet.text(caption, "base frame")
    sheet.line([(left - 9.0, caption[1]), (left + 11.0, caption[1])], 2.0, lw=0)


@styled
def draw_spring_scheme(robot: Robot) -> Figure:
    """Virtual joint model of a robot as a chain of blocks (the paper's Figure 3), about
    160 mm wide.

    `robot`: with `links`, the extended model is drawn below the reduced one.
    """
    sheet = _Sheet()
    y = 0.0
    titles = [
        "Reduced model: a 1-DoF spring in each joint",
        "Extended model: also a 6-DoF spring at the end of each link",
    ]
    for extended, title in enumerate(titles[: 2 if robot.links else 1]):
        sheet.text((0, y), title, ha="left", weight="bold")
        x = 0.0
        y = y - 14.0
        end = None
        for group in _blocks(robot.chain, bool(extended)):
            if (
                end is not None
                and x + sum(_BLOCKS[kind][0] for kind, _ in group) > _ROW_MM
            ):
                right = end[0] + 3.0
                between = y - 11.0
                y -= 22.0
                sheet.line(
                    [
                        end,
                        (right, end[1]),
                        (right, between),
                        (-4.0, between),
                        (-4.0, y),
                        (0.0, y),
                    ],
                    lw=1.2,
                )
                x = 0.0
                end = None
            for kind, label in group:
                if end is not None:
                    sheet.line([end, (x, y)], lw=1.2)
                _draw_block(sheet, kind, label, x, y)
                end = (x + _BLOCKS[kind][0], y)
                x = end[0] + (0.0 if kind == "actuator" else 3.0)
        y -= 18.0
    legend: list[tuple[Any, str]] = [(_mark(_NOWHERE, "o", 4), "Ac: actuated joint")]
    for kind, words in (("spring", "1-DoF spring"), ("6 springs", "6D: 6-DoF spring"))[
        : 2 if robot.links else 1
    ]:
        legend.append((_mark(_NOWHERE, _ZIGZAG, 10, "none", _BLOCKS[kind][2]), words))
    legend.append((Patch(fc=_BLOCKS["link"][1], ec=_INK), "rigid link"))
    note = "$q$: joint coordinate, $\\theta$: deflection of its spring, $l$: length of a link"
    return sheet.finish(legend, note, 4, (-4.0, y + 10.0), (_ROW_MM + 4.0, 2.0))


def _blocks(chain: Chain, extended: bool) -> list[list[tuple[str, str]]]:
    """Kind and label of the blocks from the base to the end-effector, in groups that
    stay in one row."""
    groups = [[("base", "")]]
    names = []
    lengths = 0
    for transform in [*chain.transforms, None]:
        if transform is not None and transform.kind == "T" and transform.constant:
            lengths += 1
            names.append(f"$l_{{{lengths}}}$")
        elif transform is None or transform.coordinate is not None:
            # All that lies between two joints is one link.
            groups += (
                [[("link", ", ".join(names)), ("6 springs", "6D")][: 1 + extended]]
                if names
                else []
            )
            names = []
            if transform is not None and transform.coordinate is not None:
                number = f"_{{{transform.coordinate + 1}}}$"
                groups.append(
                    [("actuator", f"$q{number}"), ("spring", f"$\\theta{number}")]
                )
    return [*groups, [("end-effector", "")]]


def _draw_block(sheet: _Sheet, kind: str, label: str, x: float, y: float) -> None:
    width, face, edge, text = _BLOCKS[kind]
    middle = x + width / 2
    half = 4.8 if kind == "end-effector" else 3.6
    if kind == "actuator":
        sheet.axes.add_line(_mark((middle, y), "o", width))
    elif kind != "spring":
        right = x + width
        top = y + half
        low = y - half
        sheet.axes.fill(
            [x, right, right, x],
            [low, low, top, top],
            fc=face,
            ec=edge,
            lw=1.0,
            zorder=3,
        )
    if "spring" in kind:
        sheet.axes.add_line(_mark((middle, y), _ZIGZAG, 10, "none", edge))
    for step in np.arange(x + 1.5, x + width + 0.1, 2.0) if kind == "base" else ():
        sheet.line([(step, y - half), (step - 1.6, y - half - 1.8)], lw=0.7)
    sheet.text((middle, y), text, linespacing=1.0)
    sheet.text((middle, y - 6.4 if kind == "link" else y + 6.4), label)
