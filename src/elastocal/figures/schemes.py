"""Schemes drawn from a robot's chain: links, joints and measuring points (the paper's
Figure 2), and springs (Figure 3)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
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
from elastocal.mechanics.chain import Chain, MeasuringPoint
from elastocal.mechanics.robot import Robot

_WIDTH_MM = 160.0
# Width of a row of blocks in a spring scheme.
_ROW_MM = 124.0
_POINTS_PER_MM = 72 / 25.4
# Coordinates of artists that appear in the legend only.
_NOWHERE = ((), ())
_INK = "#222222"
_GREY = "#555555"
_BLUE = PALETTE[0]
_FACE = "#D6E8F5"
_FONT = FontProperties(family="DejaVu Sans", size=9)
_TEXT_HEIGHT_MM = 4.2
# Colour and marker of the measuring points, in the order of the chain.
_POINT_STYLES = [
    (PALETTE[colour], marker)
    for colour, marker in zip((4, 2, 3, 1, 5, 0), "sDo^vP", strict=True)
]
# Rotations from base axes to (right, up, into the paper): from the side and from the
# front.
_VIEWS = np.array(
    [[[1.0, 0, 0], [0, 0, 1], [0, 1, 0]], [[0, 1, 0], [0, 0, 1], [-1, 0, 0]]]
)
# Directions whose cosine is larger than this count as parallel.
_PARALLEL = 0.95
# Drawn length of the shortest link, and the most by which the longest one exceeds it.
_SHORTEST_LINK_MM = 13.0
_MAX_EXCESS_MM = 18.0
# Total drawn length of all links, to which the excesses are reduced.
_ARM_MM = 150.0
# Length that a joint with its axis in the paper adds to the arm.
_JOINT_MM = 15.0
# Radius of a joint whose axis is normal to the paper.
_CIRCLE_MM = 3.2
# Oblique projection: displacement on the paper of a unit vector into the paper.
_DEPTH = np.array([0.53, 0.53])
_AXIS_STYLE: dict[str, Any] = {
    "lw": 0.8,
    "color": _BLUE,
    "ls": (0, (6, 1.5, 1, 1.5)),
    "zorder": 5,
}
# Marker of a spring.
_ZIGZAG = Path(
    [
        (-5, 0),
        (-4, 0),
        *zip(np.arange(-3.5, 4), [2.2, -2.2] * 4, strict=True),
        (4, 0),
        (5, 0),
    ]
)


@dataclass(frozen=True)
class DrawnLink:
    """A link on the paper.

    Attributes
    ----------
    start, end : (2,) arrays, mm from the base's origin
    label : str
        Name and length; empty for a stroke that is part of a joint.
    """

    start: np.ndarray
    end: np.ndarray
    label: str


@dataclass(frozen=True)
class DrawnJoint:
    """A joint on the paper.

    Attributes
    ----------
    number : int
        Number of the joint, from 1.
    centre : (2,) array, mm from the base's origin
    axis : (2,) array, mm, or None
        The joint's stroke along its axis; None if the axis is normal to the paper.
    """

    number: int
    centre: np.ndarray
    axis: np.ndarray | None


@dataclass(frozen=True)
class DrawnPoint:
    """A measuring point on the paper.

    Attributes
    ----------
    name : str
    node : (2,) array, mm from the base's origin
        Where the point's frame is attached to the chain.
    target : (2,) array, mm from the base's origin
        The measured point; it differs from the node if the target has an offset.
    """

    name: str
    node: np.ndarray
    target: np.ndarray


@dataclass(frozen=True)
class Layout:
    """Positions of all parts of a chain on the paper."""

    links: list[DrawnLink] = field(default_factory=list)
    joints: list[DrawnJoint] = field(default_factory=list)
    points: list[DrawnPoint] = field(default_factory=list)

    def collect_ends(self) -> np.ndarray:
        """Positions (N, 2) of the base's origin, link ends and measured points."""
        return np.array(
            [
                np.zeros(2),
                *(link.end for link in self.links),
                *(point.target for point in self.points),
            ]
        )


def lay_out_chain(chain: Chain) -> tuple[Layout, np.ndarray]:
    """Lay out a chain in a side view with the base's z axis upwards.

    Whatever extends across the view recedes obliquely. Joints normal to the paper are
    bent so that the links form an arch; all other joints stay at zero. Lengths are not
    to scale, so that 41 mm remains visible next to 1150 mm.

    Returns
    -------
    layout : Layout
    view : (3, 3) array
        Rotation from base axes to (right, up, into the paper).
    """
    view = max(_VIEWS, key=lambda view: len(_find_normal_joints(chain, view)))
    frames = _compute_bent_frames(chain, view)
    strokes = _scale_links(chain, frames)
    pen = _Pen()
    for index, frame in enumerate(frames):
        for point in chain.points:
            if point.after == index:
                pen.draw_point(point, frame)
        if index == len(chain.transforms):
            break
        transform = chain.transforms[index]
        if index in strokes:
            pen.draw_link(*strokes[index])
        elif transform.coordinate is not None:
            following = [strokes[later][0] for later in strokes if later > index]
            pen.draw_joint(
                transform.coordinate + 1, frame[:, transform.axis], following
            )
    return pen.layout, view


class _Pen:
    """Draws a layout part by part, from the base to the end-effector."""

    def __init__(self) -> None:
        self.layout = Layout()
        self.position = np.zeros(2)
        self.direction = np.array([0.0, 1.0, 0.0])

    def draw_link(
        self, direction: np.ndarray, length_mm: float, label: str = ""
    ) -> DrawnLink:
        """Draw a stroke in a direction (right, up, into the paper)."""
        end = self.position + length_mm * _project(direction)
        link = DrawnLink(self.position, end, label)
        self.layout.links.append(link)
        self.position = end
        self.direction = direction
        return link

    def draw_point(self, point: MeasuringPoint, frame: np.ndarray) -> None:
        """Draw a measuring point, at a fixed distance if its target has an offset."""
        offset = np.array(point.offset_m)
        distance = np.linalg.norm(offset) or 1.0
        target = self.position + _project(frame @ offset / distance * _JOINT_MM)
        self.layout.points.append(DrawnPoint(point.name, self.position, target))

    def draw_joint(
        self, number: int, axis: np.ndarray, following: Sequence[np.ndarray]
    ) -> None:
        """Draw a joint; `following` are the directions of the links behind it."""
        if abs(axis[2]) > _PARALLEL:
            self._draw_normal_joint(number)
            return
        # Continue along the link before the joint, or along the one behind it.
        cosines = [direction @ axis for direction in (self.direction, *following[:1])]
        cosine = next(
            (cosine for cosine in cosines if abs(cosine) > _PARALLEL), cosines[0]
        )
        stroke = self.draw_link(-axis if cosine < -1e-9 else axis, _JOINT_MM)
        centre = (stroke.start + stroke.end) / 2
        self.layout.joints.append(DrawnJoint(number, centre, stroke.end - stroke.start))

    def _draw_normal_joint(self, number: int) -> None:
        """Draw a joint normal to the paper, neither on the ground nor on a joint."""
        used = [np.zeros(2), *(joint.centre for joint in self.layout.joints)]
        if any(np.allclose(self.position, centre) for centre in used):
            self.draw_link(self.direction, _JOINT_MM)
        self.layout.joints.append(DrawnJoint(number, self.position, None))


def _project(vector: np.ndarray) -> np.ndarray:
    """Project a vector (right, up, into the paper) obliquely onto the paper, (2,)."""
    return vector[:2] + vector[2] * _DEPTH


def _scale_links(
    chain: Chain, frames: Sequence[np.ndarray]
) -> dict[int, tuple[np.ndarray, float, str]]:
    """Direction, drawn length (mm) and label of each link, by its index in the chain."""
    lengths = {
        index: transform.constant
        for index, transform in enumerate(chain.transforms)
        if transform.kind == "T" and transform.constant
    }
    magnitudes = np.abs([*lengths.values()])
    shares = magnitudes / max(magnitudes, default=1.0)
    available = _ARM_MM - _SHORTEST_LINK_MM * len(lengths)
    excess = np.clip(available / max(shares.sum(), 1.0), 0.0, _MAX_EXCESS_MM)
    strokes = {}
    for number, (index, length) in enumerate(lengths.items()):
        direction = np.sign(length) * frames[index][:, chain.transforms[index].axis]
        value = f"{round(1000 * length, 1):g}".replace("-", "\N{MINUS SIGN}")
        label = f"$l_{{{number + 1}}}$ = {value} mm"
        strokes[index] = direction, _SHORTEST_LINK_MM + excess * shares[number], label
    return strokes


def _compute_frames(chain: Chain, view: np.ndarray) -> list[np.ndarray]:
    """Axes of the moving frame before each transform and after the last one.

    All joints are at zero; the columns are axes as (right, up, into the paper).
    """
    frames = [view]
    for transform in chain.transforms:
        rotation = np.zeros(3)
        if transform.kind == "R" and transform.coordinate is None:
            rotation[transform.axis] = transform.constant
        frames.append(frames[-1] @ Rotation.from_rotvec(rotation).as_matrix())
    return frames


def _find_normal_joints(chain: Chain, view: np.ndarray) -> list[int]:
    """Indices in the chain of the joints whose axes are normal to the paper."""
    frames = _compute_frames(chain, view)
    return [
        index
        for index, transform in enumerate(chain.transforms)
        if transform.coordinate is not None
        and abs(frames[index][2, transform.axis]) > _PARALLEL
    ]


def _compute_bent_frames(chain: Chain, view: np.ndarray) -> list[np.ndarray]:
    """Frames as in `_compute_frames`, bent into an arch.

    Each joint normal to the paper turns the longest link before the next such joint
    into its direction on the arch.
    """
    frames = _compute_frames(chain, view)
    normal = _find_normal_joints(chain, view)
    headings: dict[int, float] = {}
    for joint, end in zip(normal, [*normal[1:], len(frames)], strict=False):
        links = [
            transform.constant * frames[index][:2, transform.axis]
            for index, transform in enumerate(chain.transforms[:end])
            if index > joint and transform.kind == "T"
        ]
        longest = max(links, key=np.linalg.norm, default=np.zeros(2))
        if np.linalg.norm(longest) > 1e-9:
            headings[joint] = np.arctan2(longest[1], longest[0])
    arch = np.radians(np.linspace(70.0, -45.0, len(headings)))
    turns = {
        joint: direction - heading
        for (joint, heading), direction in zip(headings.items(), arch, strict=True)
    }
    bent = []
    turn = 0.0
    for index, frame in enumerate(frames):
        bent.append(Rotation.from_rotvec([0, 0, turn]).as_matrix() @ frame)
        turn = turns.get(index, turn)
    return bent


@dataclass(frozen=True)
class _Label:
    """A label that is to be placed near the part that it names.

    Attributes
    ----------
    text, gid : str
        The words, and the name of the artist.
    anchor : (2,) array, mm
        Position of the named part.
    distance_mm : float
        Smallest distance from the anchor.
    stroke : (2,) array or None
        Direction of a stroke that the label should stand across of.
    frame : str
        Colour of a frame around the label; empty for none.
    """

    text: str
    gid: str
    anchor: np.ndarray
    distance_mm: float
    stroke: np.ndarray | None = None
    frame: str = ""

    @property
    def size_mm(self) -> np.ndarray:
        """Width and height with a margin."""
        extents = TextPath((0, 0), self.text, prop=_FONT).get_extents()
        size = np.array([extents.width / _POINTS_PER_MM, _TEXT_HEIGHT_MM])
        return size + (2.4 if self.frame else (3.0, 1.2))

    def choose_direction(self, middle: np.ndarray) -> np.ndarray:
        """Choose the unit vector away from the middle of the sheet, across the stroke."""
        outward = self.anchor - middle
        if self.stroke is None:
            direction = outward
        else:
            right, up = self.stroke
            side = np.sign(right * outward[1] - up * outward[0])
            direction = np.array([-up, right]) * side
        return direction / (np.linalg.norm(direction) or 1.0)

    def rank_positions(self, middle: np.ndarray) -> Iterator[tuple[float, np.ndarray]]:
        """Distances and unit vectors from the anchor, the preferred ones first.

        Near positions are preferred, and those outside and across the stroke.
        """
        preferred = self.choose_direction(middle)
        angles = np.radians(np.arange(0, 360, 15))
        units = np.column_stack([np.cos(angles), np.sin(angles)])
        distances = np.arange(self.distance_mm, self.distance_mm + 45.0)
        yield from sorted(
            product(distances, units),
            key=lambda position: round(position[0] - 3.0 * position[1] @ preferred, 6),
        )


class _Sheet:
    """A sheet of paper in millimetres that records which areas are occupied, so that
    labels find free space.

    Attributes
    ----------
    figure, axes
        The drawing, with one unit a millimetre.
    occupied : (N, 4) array
        Occupied boxes: left, lower, right and upper bound.
    middle : (2,) array
        Middle of the drawing; labels are placed away from it.
    """

    def __init__(self, middle: np.ndarray) -> None:
        self.figure = Figure()
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set_axis_off()
        self.occupied = np.empty((0, 4))
        self.middle = middle

    def draw_line(self, points: Sequence[Any], **style: Any) -> None:
        """Draw a line through points."""
        usual: dict[str, Any] = {
            "color": _INK,
            "lw": 0.8,
            "solid_capstyle": "round",
        }
        self.axes.plot(*np.array(points).T, **usual | style)

    def occupy(self, start: Any, end: Any, half_width: float) -> None:
        """Keep labels away from a straight stroke."""
        start = np.array(start)
        end = np.array(end)
        shares = np.linspace(0, 1, int(np.linalg.norm(end - start)) + 2)
        centres = start + shares[:, None] * (end - start)
        self._add_boxes(centres - half_width, centres + half_width)

    def _add_boxes(self, lows: np.ndarray, highs: np.ndarray) -> None:
        self.occupied = np.vstack([self.occupied, np.hstack([lows, highs])])

    def draw_obstacle(
        self, points: Sequence[Any], half_width: float, **style: Any
    ) -> None:
        """Draw a line and keep labels away from it."""
        self.draw_line(points, **style)
        self.occupy(points[0], points[-1], half_width)

    def draw_text(self, position: Any, text: str, **style: Any) -> None:
        """Write a text, centred at its position by default."""
        usual: dict[str, Any] = {
            "ha": "center",
            "va": "center",
            "fontproperties": _FONT,
            "color": _INK,
            "zorder": 8,
        }
        self.axes.text(position[0], position[1], text, **usual | style)

    def place_label(self, label: _Label) -> None:
        """Put a label at the best free position; distant labels get a leader."""
        size = label.size_mm
        for distance, unit in label.rank_positions(self.middle):
            near = label.anchor + distance * unit
            # The box touches `near` with the middle of the side, or with the corner,
            # that faces the anchor.
            side = np.where(np.abs(unit) > 0.3, np.sign(unit), 0.0)
            centre = near + side * size / 2
            # Nothing may come between a label and the part that it names, with or
            # without a leader; the part itself lies near the anchor.
            steps = np.arange(_CIRCLE_MM + 1.5, distance)
            leader = label.anchor + np.outer(steps, unit)
            lows = np.vstack([centre - size / 2, leader - 0.4])
            highs = np.vstack([centre + size / 2, leader + 0.4])
            if self._is_free(lows, highs):
                break
        self._add_boxes(centre[None] - size / 2, centre[None] + size / 2)
        if distance > label.distance_mm + 3.0 or label.frame:
            colour = label.frame or _INK
            self.draw_obstacle(
                [label.anchor, near], 0.3, lw=0.7, color=colour, zorder=6
            )
        box = None
        if label.frame:
            box = {"fc": "white", "ec": label.frame, "pad": 2.4}
        self.draw_text(centre, label.text, gid=label.gid, bbox=box)

    def _is_free(self, lows: np.ndarray, highs: np.ndarray) -> bool:
        """Tell whether boxes (M, 2) overlap no occupied box."""
        beyond = self.occupied[:, None, :2] >= highs
        before = self.occupied[:, None, 2:] <= lows
        return bool((beyond | before).any(axis=2).all())

    def finish(
        self,
        legend: Sequence[tuple[Any, str]],
        title: str,
        columns: int,
        low: Any,
        high: Any,
    ) -> Figure:
        """Crop the sheet and add a legend below.

        Parameters
        ----------
        legend
            Artists and labels.
        title : str
            Title of the legend.
        columns : int
            Columns of the legend.
        low, high : (2,) arrays, mm
            Corners of the drawing, which is centred in the usual width.
        """
        half_width = max(_WIDTH_MM, high[0] - low[0] + 6.0) / 2
        legend_height = 12.0 + 7.0 * -(-len(legend) // columns)
        middle = (low[0] + high[0]) / 2
        height = high[1] - low[1] + 6.0 + legend_height
        self.axes.set(
            xlim=(middle - half_width, middle + half_width),
            ylim=(low[1] - 3.0 - legend_height, high[1] + 3.0),
        )
        self.figure.set_size_inches(2 * half_width / 25.4, height / 25.4)
        self.figure.legend(
            *zip(*legend, strict=True),
            title=title,
            ncols=columns,
            loc="lower center",
            labelspacing=1.1,
            handleheight=1.6,
            handlelength=3.6,
        )
        return self.figure


@styled
def draw_kinematic_scheme(robot: Robot) -> Figure:
    """Draw the equivalent kinematic scheme of a serial robot, about 160 mm wide.

    It is the paper's Figure 2. A joint about its own link is moved along its axis,
    which leaves it the same joint, so that the joints of a wrist are drawn apart.
    Artists have a gid: ``joint-1``, ``length-1``, ``point-NAME``.
    """
    layout, view = lay_out_chain(robot.chain)
    ends = layout.collect_ends()
    sheet = _Sheet(ends.mean(axis=0))
    _draw_base(sheet, view, ends[:, 0].min() - 27.0)
    for link in layout.links:
        sheet.draw_obstacle([link.start, link.end], 0.9, lw=3.0, color=_GREY, zorder=2)
    for joint in layout.joints:
        _draw_joint(sheet, joint)
    for joint in layout.joints:
        sheet.place_label(
            _Label(
                f"$q_{{{joint.number}}}$",
                f"joint-{joint.number}",
                joint.centre,
                _CIRCLE_MM,
                joint.axis,
            )
        )
    axis_sample = (Patch(fc=_FACE, ec=_BLUE, lw=1.3), Line2D([], [], **_AXIS_STYLE))
    circle_sample = (_mark(_NOWHERE, "o", 4), _mark(_NOWHERE, "o", 1, _BLUE))
    legend: list[tuple[Any, str]] = [
        (axis_sample, "joint, axis in plane"),
        (circle_sample, "joint, axis normal to plane"),
        *_draw_points(sheet, layout.points),
    ]
    named = [link for link in layout.links if link.label]
    for number, link in enumerate(named, start=1):
        sheet.place_label(
            _Label(
                link.label,
                f"length-{number}",
                (link.start + link.end) / 2,
                1.0,
                link.end - link.start,
            )
        )
    low = sheet.occupied[:, :2].min(axis=0)
    high = sheet.occupied[:, 2:].max(axis=0) + np.array([0.0, 7.0])
    sheet.draw_text(((low[0] + high[0]) / 2, high[1] - 2.0), robot.name, weight="bold")
    note = (
        "Lengths are not to scale. Joints are shown moved along their axes; "
        "parts without a length have no label."
    )
    return sheet.finish(legend, note, 3, low, high)


def _draw_joint(sheet: _Sheet, joint: DrawnJoint) -> None:
    """Draw a cylinder along an axis in the paper, or a circle around a normal one."""
    centre = joint.centre
    if joint.axis is None:
        sheet.occupy(centre, centre, _CIRCLE_MM)
        sheet.axes.add_line(_mark(centre, "o", 2 * _CIRCLE_MM))
        sheet.axes.add_line(_mark(centre, "o", 1, _BLUE))
        return
    unit = joint.axis / np.linalg.norm(joint.axis)
    for half_length, width, colour in ((4.0, 5.2, _BLUE), (3.6, 4.4, _FACE)):
        sheet.draw_line(
            [centre - half_length * unit, centre + half_length * unit],
            lw=width * _POINTS_PER_MM,
            color=colour,
            solid_capstyle="butt",
            zorder=4,
        )
    sheet.draw_obstacle([centre - 6 * unit, centre + 6 * unit], 0.5, **_AXIS_STYLE)
    sheet.occupy(centre - 2 * unit, centre + 2 * unit, 2.6)


def _draw_points(
    sheet: _Sheet, points: Sequence[DrawnPoint]
) -> list[tuple[Line2D, str]]:
    """Draw and label the measuring points; returns their entries of the legend."""
    legend = []
    for number, point in enumerate(points):
        # Points at the same position are drawn over each other, each smaller than the
        # one below.
        below = sum(
            np.allclose(lower.target, point.target) for lower in points[:number]
        )
        size_mm = max(0.7, 2.3 - 0.9 * below)
        colour, marker = _POINT_STYLES[number % len(_POINT_STYLES)]
        dotted = (0, (2, 1.5))
        sheet.draw_obstacle(
            [point.node, point.target], 1.4, lw=0.9, ls=dotted, zorder=3
        )
        sheet.axes.add_line(
            _mark(point.target, marker, size_mm, colour, _INK, mew=0.6, zorder=6.5)
        )
        gid = f"point-{point.name}"
        sheet.place_label(_Label(point.name, gid, point.target, 7.0, frame=colour))
        sample = _mark(_NOWHERE, marker, 2.3, colour, _INK, mew=0.6)
        legend.append((sample, f"measuring point {point.name}"))
    return legend


def _mark(
    position: Any,
    marker: Any,
    size_mm: float,
    face: str = _FACE,
    edge: str = _BLUE,
    **style: Any,
) -> Line2D:
    """Make a single marker."""
    usual: dict[str, Any] = {
        "ls": "",
        "marker": marker,
        "ms": size_mm * _POINTS_PER_MM,
        "mfc": face,
        "mec": edge,
        "mew": 1.3,
        "zorder": 4,
    }
    return Line2D(*np.reshape(position, (2, -1)), **usual | style)


def _draw_base(sheet: _Sheet, view: np.ndarray, left: float) -> None:
    """Draw the ground under the origin, and the base's axes at x = `left` mm."""
    sheet.draw_obstacle([(-9, 0), (9, 0)], 1.0, lw=1.6)
    for x in np.arange(-8.0, 9.1, 2.0):
        sheet.draw_obstacle([(x, 0), (x - 2.6, -2.6)], 0.5, lw=0.7)
    origin = np.array([left, 0.0])
    caption_y = -5.0 if view[2].sum() > 0 else -12.0
    directions = ([9.0, 0.0], [0.0, 9.0], 9.0 * _DEPTH)
    for direction, row in zip(directions, view, strict=True):
        axis = int(np.argmax(np.abs(row)))
        # In the view from the front -x points into the paper, so x is drawn out of it.
        tip = origin + np.array(direction) * row[axis]
        arrow = {"arrowstyle": "-|>", "color": _INK, "shrinkA": 0, "shrinkB": 0}
        sheet.axes.annotate("", tuple(tip), (left, 0.0), arrowprops=arrow)
        name_position = tip + 2.4 * (tip - origin) / np.linalg.norm(tip - origin)
        sheet.occupy(origin, name_position, 2.2)
        sheet.draw_text(name_position, f"${'xyz'[axis]}$")
    sheet.draw_text((left + 1.0, caption_y), "base frame")
    sheet.occupy((left - 9.0, caption_y), (left + 11.0, caption_y), 2.0)


@dataclass(frozen=True)
class _BlockStyle:
    """Look of one kind of block in a spring scheme."""

    width_mm: float
    face: str
    edge: str
    text: str


_BLOCK_STYLES = {
    "base": _BlockStyle(11.0, "white", _INK, "Base"),
    "link": _BlockStyle(11.0, "#E4E4E4", _INK, "Link"),
    "actuator": _BlockStyle(8.0, _FACE, _BLUE, "Ac"),
    "spring": _BlockStyle(10.0, "none", PALETTE[4], ""),
    "6 springs": _BlockStyle(12.0, "#FBE9DD", PALETTE[1], ""),
    "end-effector": _BlockStyle(17.0, "white", _INK, "End-\neffector"),
}


@styled
def draw_spring_scheme(robot: Robot) -> Figure:
    """Draw the virtual joint model of a robot as a chain of blocks, about 160 mm wide.

    It is the paper's Figure 3. For a robot with `links`, the extended model is drawn
    below the reduced one.
    """
    sheet = _Sheet(np.zeros(2))
    title = "Reduced model: a 1-DoF spring in each joint"
    y = _draw_model(sheet, title, _list_blocks(robot.chain), 0.0)
    legend: list[tuple[Any, str]] = [
        (_mark(_NOWHERE, "o", 4), "Ac: actuated joint"),
        (_sample_spring("spring"), "1-DoF spring"),
    ]
    if robot.links:
        title = "Extended model: also a 6-DoF spring at the end of each link"
        blocks = _list_blocks(robot.chain, with_link_springs=True)
        y = _draw_model(sheet, title, blocks, y)
        legend.append((_sample_spring("6 springs"), "6D: 6-DoF spring"))
    legend.append((Patch(fc=_BLOCK_STYLES["link"].face, ec=_INK), "rigid link"))
    note = "$q$: joint coordinate, $\\theta$: deflection of its spring, $l$: length of a link"
    return sheet.finish(legend, note, 4, (-4.0, y + 10.0), (_ROW_MM + 4.0, 2.0))


def _sample_spring(kind: str) -> Line2D:
    return _mark(_NOWHERE, _ZIGZAG, 10, "none", _BLOCK_STYLES[kind].edge)


def _draw_model(
    sheet: _Sheet, title: str, groups: list[list[tuple[str, str]]], y: float
) -> float:
    """Draw the blocks of a model under a title at height `y`.

    A group that does not fit into the row starts the next one.

    Returns
    -------
    float
        Height of the title of the next model.
    """
    sheet.draw_text((0, y), title, ha="left", weight="bold")
    x = 0.0
    y -= 14.0
    end: tuple[float, float] | None = None
    for group in groups:
        width = sum(_BLOCK_STYLES[kind].width_mm for kind, _ in group)
        if end is not None and x + width > _ROW_MM:
            sheet.draw_line(_route_to_next_row(end), lw=1.2)
            x = 0.0
            y -= 22.0
            end = None
        for kind, label in group:
            if end is not None:
                sheet.draw_line([end, (x, y)], lw=1.2)
            _draw_block(sheet, kind, label, (x, y))
            end = (x + _BLOCK_STYLES[kind].width_mm, y)
            gap = 0.0 if kind == "actuator" else 3.0
            x = end[0] + gap
    return y - 18.0


def _route_to_next_row(end: tuple[float, float]) -> list[tuple[float, float]]:
    """Points of the connection from the end of a row to the start of the next one."""
    right = end[0] + 3.0
    between = end[1] - 11.0
    below = end[1] - 22.0
    return [
        end,
        (right, end[1]),
        (right, between),
        (-4.0, between),
        (-4.0, below),
        (0.0, below),
    ]


def _list_blocks(
    chain: Chain, *, with_link_springs: bool = False
) -> list[list[tuple[str, str]]]:
    """Kind and label of the blocks from the base to the end-effector, in groups that
    stay in one row."""
    groups = [[("base", "")]]
    names: list[str] = []
    length_count = 0
    for transform in [*chain.transforms, None]:
        if transform is not None and transform.kind == "T" and transform.constant:
            length_count += 1
            names.append(f"$l_{{{length_count}}}$")
        elif transform is None or transform.coordinate is not None:
            # All lengths between two joints belong to one link.
            if names:
                springs = [("6 springs", "6D")] if with_link_springs else []
                groups.append([("link", ", ".join(names)), *springs])
            names = []
            if transform is not None and transform.coordinate is not None:
                index = f"_{{{transform.coordinate + 1}}}$"
                groups.append(
                    [("actuator", f"$q{index}"), ("spring", f"$\\theta{index}")]
                )
    return [*groups, [("end-effector", "")]]


def _draw_block(
    sheet: _Sheet, kind: str, label: str, start: tuple[float, float]
) -> None:
    """Draw a block whose left side has its middle at `start`, mm."""
    style = _BLOCK_STYLES[kind]
    x_left, y = start
    x_right = x_left + style.width_mm
    middle = x_left + style.width_mm / 2
    half_height = 4.8 if kind == "end-effector" else 3.6
    top = y + half_height
    bottom = y - half_height
    if kind == "actuator":
        sheet.axes.add_line(_mark((middle, y), "o", style.width_mm))
    elif kind != "spring":
        sheet.axes.fill(
            [x_left, x_right, x_right, x_left],
            [bottom, bottom, top, top],
            fc=style.face,
            ec=style.edge,
            lw=1.0,
            zorder=3,
        )
    if "spring" in kind:
        sheet.axes.add_line(_mark((middle, y), _ZIGZAG, 10, "none", style.edge))
    if kind == "base":
        for x in np.arange(x_left + 1.5, x_left + style.width_mm + 0.1, 2.0):
            sheet.draw_line([(x, bottom), (x - 1.6, bottom - 1.8)], lw=0.7)
    sheet.draw_text((middle, y), style.text, linespacing=1.0)
    sheet.draw_text((middle, y - 6.4 if kind == "link" else y + 6.4), label)
