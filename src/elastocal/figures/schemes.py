"""Figures 2 and 3 of the paper, drawn from a robot's chain: its kinematic scheme and its virtual joints (VJM).

Everything is laid out in millimetres of paper. The kinematic scheme is a side view with the base's z upwards, in an oblique
projection: what lies across the view recedes at an angle. Joints across the view are bent so that the links run in an arch,
the others stay at zero. Lengths are not to scale, so that a link of 41 mm can be seen next to one of 1150 mm.
"""

from dataclasses import dataclass, field
from itertools import combinations, product

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patches import Circle, FancyBboxPatch, Polygon
from matplotlib.textpath import TextPath

from elastocal.figures.style import PALETTE

WIDTH_MM = 160.0
MARGIN_MM = 3.0
MM_PER_INCH = 25.4
FONT = FontProperties(family="DejaVu Sans", size=9)
BOLD = FontProperties(family="DejaVu Sans", size=9, weight="bold")
TEXT_HEIGHT_MM = 3.6

INK, GREY = "#222222", "#555555"
BLUE, RED, GREEN, PINK, ORANGE, SKY = PALETTE[:6]
POINT_COLOURS = (ORANGE, GREEN, PINK, RED, SKY, BLUE)
POINT_MARKERS = "sDo^vP"
JOINT_FACE, LINK_FACE = "#D6E8F5", "#E4E4E4"

# Links after the joints that bend run from this heading to that one, in degrees above the horizontal. Headings that only
# fall, by less than 180 degrees in all, make an arch that cannot meet itself; links that recede can still cross it, so there
# is a choice of arches and of directions on paper, and links count as apart from ENOUGH_MM on.
FIRST_HEADING, LAST_HEADINGS = 70.0, (-45.0, -20.0, 5.0, 30.0)
ENOUGH_MM = 7.0
DEPTH_RATIO = 0.75
DEPTH_ANGLES = (*range(45, 66, 5), *range(40, 24, -5), *range(115, 156, 5))
PARALLEL = 0.99

# The drawn length of a link: the shortest, more for each joint that is drawn on it, and a part in proportion to its length.
SHORTEST_MM, CARRIED_MM = 13.0, 7.0
SCALES_MM = tuple(range(50, -1, -5))
DRAWING_MM = (100.0, 84.0)
RADIUS_MM, HALF_LENGTH_MM, HALF_WIDTH_MM = 3.4, 4.2, 2.6
LEGEND_ROW_MM, LEGEND_HALF_MM, LEGEND_GAP_MM = 12.0, 4.0, 5.0


@dataclass
class _Segment:
    """A translation as drawn; `length_m` is 0 for one that only separates joints whose axes meet."""

    direction: np.ndarray
    length_m: float
    label: str = ""
    carried: list = field(default_factory=list)
    start: np.ndarray = None
    end: np.ndarray = None


@dataclass
class _Joint:
    number: int
    axis: np.ndarray
    carrier: _Segment = None
    place: np.ndarray = None

    @property
    def across(self):
        """Whether its axis points along the line of sight."""
        return abs(self.axis[2]) > PARALLEL


@dataclass
class _Point:
    name: str
    offset: np.ndarray
    node: np.ndarray = None
    place: np.ndarray = None


class _Sheet:
    """A sheet of paper in millimetres that knows which of its places are taken, to find room for labels."""

    def __init__(self):
        self.figure = Figure()
        self.axes = self.figure.add_axes((0, 0, 1, 1))
        self.axes.set_axis_off()
        self.taken = np.empty((0, 4))

    def take(self, start, end, half_width):
        """Keep labels off the stroke from `start` to `end`."""
        self.taken = np.vstack([self.taken, _boxes_along(start, end, half_width)])

    def line(self, points, **style):
        """A line through points."""
        self.axes.plot(*np.transpose(points), **{"color": INK, "lw": 0.8, "solid_capstyle": "round", **style})

    def text(self, place, text, **style):
        """A text, centred on its place unless told otherwise."""
        style = {"ha": "center", "va": "center", "fontproperties": FONT, "color": INK, "zorder": 8, **style}
        return self.axes.text(*place, text, **style)

    def label(self, text, anchors, away, reach, gid, frame=None):
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
            rounded = FancyBboxPatch(corner, *extent, boxstyle="round,pad=0,rounding_size=0.8", fc="white", ec=frame, lw=1.0)
            rounded.set(zorder=7, gid=f"{gid}-box")
            self.axes.add_patch(rounded)
        self.text(centre, text, gid=gid)

    def _free_place(self, anchors, size, away, reach):
        choices = []
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

    def _is_free(self, low, high):
        clear = (self.taken[:, :2] >= high) | (self.taken[:, 2:] <= low)
        return clear.any(axis=1).all()

    def _leads_freely(self, anchor, end):
        # With or without a leader, nothing may come between a label and what it names, which itself lies near the anchor.
        length = np.linalg.norm(end - anchor)
        start = anchor + (end - anchor) * min(1.0, (RADIUS_MM + 1.5) / length)
        return all(self._is_free(box[:2], box[2:]) for box in _boxes_along(start, end, 0.2))

    def finish(self, low, high, width=WIDTH_MM):
        """Cut the sheet to what lies between two corners, centred in the width that is asked for."""
        low, high = np.array(low) - MARGIN_MM, np.array(high) + MARGIN_MM
        spare = max(0.0, width - (high - low)[0]) / 2
        low[0], high[0] = low[0] - spare, high[0] + spare
        self.axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        self.figure.set_size_inches(*((high - low) / MM_PER_INCH))
        return self.figure


def kinematic_scheme(robot):
    """Equivalent kinematic scheme of a serial robot (the paper's Figure 2), drawn from its chain.

    Parameters
    ----------
    robot : Robot
        Any chain of revolute joints about x, y and z.

    Returns
    -------
    matplotlib.figure.Figure
        About 160 mm wide. Artists have a gid: ``joint-1``, ``length-1``, ``point-NAME``, ``point-NAME-box``.

    Notes
    -----
    A joint that turns about its own link is drawn on that link instead of at its end: moved along its axis, it is the same
    joint. So the three joints of a spherical wrist can be seen apart.
    """
    items, depth = _laid_out(robot.chain)
    segments, joints, points = ([i for i in items if isinstance(i, kind)] for kind in (_Segment, _Joint, _Point))
    sheet = _Sheet()
    _draw_base(sheet, any(abs(s.direction[2]) > 1 - PARALLEL for s in segments), _view(robot.chain), depth)
    for segment in segments:
        _draw_segment(sheet, segment)
    for joint in joints:
        _draw_joint(sheet, joint.place, None if joint.across else _projected(joint.axis, depth))
    _draw_points(sheet, points)
    _label_scheme(sheet, segments, joints, points)
    low, high = sheet.taken[:, :2].min(axis=0), sheet.taken[:, 2:].max(axis=0)
    top = high[1] + 7.0
    low[1] = _kinematic_legend(sheet, segments, joints, points, (low + high)[0] / 2, low[1] - 7.0)
    sheet.text(((low + high)[0] / 2, top), robot.name, fontproperties=BOLD)
    return sheet.finish(low, (high[0], top + TEXT_HEIGHT_MM / 2))


def _boxes_along(start, end, half_width):
    steps = max(2, int(np.ceil(np.linalg.norm(end - start))) + 1)
    centres = start + np.linspace(0.0, 1.0, steps)[:, None] * (end - start)
    return np.hstack([centres - half_width, centres + half_width])


def _text_width(text, font=FONT):
    return TextPath((0, 0), text, prop=font).get_extents().width * MM_PER_INCH / 72


def _subscripted(letter, number):
    return f"${letter}_{{{number}}}$"


def _millimetres(length_m):
    return f"{round(1000 * length_m, 1):g}".replace("-", "\N{MINUS SIGN}")


def _rotation(axis, angle):
    matrix = np.eye(3)
    second, third = (axis + 1) % 3, (axis + 2) % 3
    matrix[[second, third], [second, third]] = np.cos(angle)
    matrix[third, second], matrix[second, third] = np.sin(angle), -np.sin(angle)
    return matrix


def _frames(chain):
    """Axes of the moving frame before each transform and after the last, all joints at zero."""
    frames = [np.eye(3)]
    for transform in chain.transforms:
        turns = transform.kind == "R" and transform.coordinate is None
        frames.append(frames[-1] @ _rotation(transform.axis, transform.constant) if turns else frames[-1])
    return frames


def _view(chain):
    """Base axes to (right, up, into the paper): z is up, and most of the joints that are not about z point into the paper."""
    along = np.zeros(3)
    for transform, frame in zip(chain.transforms, _frames(chain), strict=False):
        if transform.coordinate is not None:
            along += np.abs(frame[:, transform.axis]) > PARALLEL
    if along[0] > along[1]:
        return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def _walk(chain, last_heading):
    """Segments, joints and points in the order of the chain, their directions as (right, up, into the paper)."""
    view = _view(chain)
    frames = [view @ frame for frame in _frames(chain)]
    turns = _turns(chain, frames, last_heading)
    items, lengths = [], 0
    for index in range(len(chain.transforms) + 1):
        frame = _rotation(2, turns[index]) @ frames[index]
        items += [_Point(p.name, frame @ np.array(p.offset_m)) for p in chain.points if p.after == index]
        if index == len(chain.transforms):
            return items
        transform = chain.transforms[index]
        direction = frame[:, transform.axis]
        if transform.kind == "R" and transform.coordinate is not None:
            items.append(_Joint(transform.coordinate + 1, direction))
        elif transform.kind == "T" and transform.constant != 0:
            lengths += 1
            label = f"{_subscripted('l', lengths)} = {_millimetres(transform.constant)} mm"
            items.append(_Segment(np.sign(transform.constant) * direction, abs(transform.constant), label))


def _turns(chain, frames, last_heading):
    """Angle in the plane of the paper, before each transform and after the last, by which the joints have turned the frame.

    Only joints across the view turn it, and each such turn shifts the headings of all that follows: so the headings at zero
    are enough to reach the wanted ones. A joint is bent for the longest link before the next one that bends.
    """
    bends = [
        index
        for index, (transform, frame) in enumerate(zip(chain.transforms, frames, strict=False))
        if transform.coordinate is not None and abs(frame[2, transform.axis]) > PARALLEL
    ]
    longest = {}
    for index, end in zip(bends, [*bends, len(chain.transforms)][1:], strict=True):
        flat = [_flat_vector(chain.transforms[i], frames[i]) for i in range(index, end)]
        vector = max(flat, key=np.linalg.norm)
        if np.linalg.norm(vector) > 0:
            longest[index] = np.arctan2(vector[1], vector[0])
    wanted = dict(zip(longest, np.radians(np.linspace(FIRST_HEADING, last_heading, len(longest))), strict=True))
    turns = [0.0]
    for index in range(len(chain.transforms)):
        turns.append(wanted[index] - longest[index] if index in wanted else turns[-1])
    return turns


def _flat_vector(transform, frame):
    """What of a translation lies in the plane of the paper."""
    if transform.kind == "R":
        return np.zeros(2)
    return np.round(transform.constant * frame[:2, transform.axis], 9)


def _spread(items):
    """Joints that share a place, apart: on the links whose direction is their axis, or with a separator between them."""
    spread, run, before = [], [], None
    if isinstance(_without_points(items)[0], _Joint):
        # A joint in the base's origin would be drawn on the ground.
        items = [_Segment(np.array([0.0, 1.0, 0.0]), 0.0), *items]
    for item in [*items, None]:
        if isinstance(item, _Segment) or item is None:
            spread += _spread_run(run, before, item)
            run, before = [], item
            spread += [item] if item else []
        else:
            run.append(item)
    return spread


def _without_points(items):
    return [item for item in items if not isinstance(item, _Point)]


def _spread_run(run, before, after):
    """Joints and points between two segments; the first joint may move back along its axis, the last one forward."""
    left = _without_points(run)
    if before and left and _turns_about(left[0], before, alone=len(left) == 1):
        _carry(left.pop(0), before)
    if after and left and _turns_about(left[-1], after, alone=len(left) == 1):
        _carry(left.pop(), after)
    spread = []
    for item in run:
        if any(item is joint for joint in left[1:]):
            spread.append(_Segment(before.direction, 0.0))
        spread.append(item)
    return spread


def _turns_about(joint, segment, alone):
    # Across the view a joint is a circle, which looks best at the corner: it moves only to make room for another.
    return abs(joint.axis @ segment.direction) > PARALLEL and not (alone and joint.across)


def _carry(joint, segment):
    joint.carrier = segment
    segment.carried.append(joint)


def _projected(vector, depth):
    return vector[:2] + vector[2] * depth


def _laid_out(chain):
    """Everything at its place, and the direction on paper of what recedes.

    The first choice whose links are apart, else the one that keeps them furthest apart; the scale is the largest whose drawing
    is not larger than DRAWING_MM.
    """
    best, chosen = -1.0, None
    for last_heading, angle in product(LAST_HEADINGS, np.radians(DEPTH_ANGLES)):
        items = _spread(_walk(chain, last_heading))
        depth = DEPTH_RATIO * np.array([np.cos(angle), np.sin(angle)])
        _place(items, SCALES_MM[0], depth)
        clearance = _clearance(items)
        if clearance > best + 1e-6:
            best, chosen = clearance, (items, depth)
        if clearance == ENOUGH_MM:
            break
    items, depth = chosen
    for scale in SCALES_MM:
        places = _place(items, scale, depth)
        if (np.ptp(places, axis=0) <= DRAWING_MM).all():
            break
    return items, depth


def _clearance(items):
    """Smallest distance between links, up to ENOUGH_MM; of two that meet, between the halves away from there."""
    segments, nearest = [item for item in items if isinstance(item, _Segment)], ENOUGH_MM
    for (i, one), (j, other) in combinations(enumerate(segments), 2):
        halves = ((0.0, 0.5), (0.5, 1.0)) if j == i + 1 else ((0.0, 1.0), (0.0, 1.0))
        a, b = _samples(one, *halves[0]), _samples(other, *halves[1])
        nearest = min(nearest, np.linalg.norm(a[:, None] - b, axis=2).min())
    return nearest


def _samples(segment, first, last):
    return segment.start + np.linspace(first, last, 25)[:, None] * (segment.end - segment.start)


def _place(items, scale, depth):
    """Places on paper of everything, in millimetres from the base's origin."""
    longest = max((item.length_m for item in items if isinstance(item, _Segment)), default=0.0)
    here, places = np.zeros(3), []
    for item in items:
        place = _projected(here, depth)
        if isinstance(item, _Segment):
            item.start = place
            here = here + item.direction * _drawn_length(item, longest, scale)
            item.end = place = _projected(here, depth)
            for number, joint in enumerate(item.carried, start=1):
                joint.place = item.start + (item.end - item.start) * number / (len(item.carried) + 1)
        elif isinstance(item, _Point):
            offset = np.linalg.norm(item.offset)
            along = item.offset / offset * (SHORTEST_MM + 0.3 * scale) if offset else np.zeros(3)
            item.node, item.place = place, _projected(here + along, depth)
            place = item.place
        elif item.carrier is None:
            item.place = place
        places.append(place)
    return np.array(places)


def _drawn_length(segment, longest, scale):
    return SHORTEST_MM + CARRIED_MM * len(segment.carried) + scale * (segment.length_m / longest if longest else 0.0)


def _draw_base(sheet, oblique, view, depth):
    """Ground under the origin, and the base's axes beside it, where the first link does not hide them."""
    half, drop = 9.0, 2.6
    sheet.line([(-half, 0), (half, 0)], lw=1.6)
    for x in np.arange(-half + 1.0, half + 0.1, 2.0):
        sheet.line([(x, 0), (x - drop, -drop)], lw=0.7)
    sheet.take(np.array([-half - 1.0, -drop / 2]), np.array([half, -drop / 2]), drop / 2 + 0.5)
    origin, length = np.array([-27.0, 0.0]), 9.0
    arrows = {"right": np.array([length, 0.0]), "up": np.array([0.0, length])}
    if oblique:
        arrows["into"] = 0.8 * length * depth / DEPTH_RATIO
    for row, name in enumerate(("right", "up", "into")):
        axis = int(np.argmax(np.abs(view[row])))
        if name not in arrows:
            continue
        # The view from the front has -x into the paper: x itself then comes out of it.
        tip = origin + arrows[name] * view[row, axis]
        arrow = {"arrowstyle": "-|>", "color": INK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
        sheet.axes.annotate("", tip, origin, arrowprops=arrow)
        place = tip + (tip - origin) / np.linalg.norm(tip - origin) * 2.2
        sheet.text(place, f"${'xyz'[axis]}$")
        sheet.take(origin, place, 1.8)
    sheet.axes.add_patch(Circle(origin, 0.6, fc=INK, ec="none", zorder=3))
    caption = origin + np.array([length / 2 - 1.0, -4.5 if not oblique or view[2].sum() > 0 else -10.0])
    sheet.text(caption, "base frame")
    sheet.take(caption - [9.0, 0], caption + np.array([9.0, 0]), TEXT_HEIGHT_MM / 2)


def _draw_segment(sheet, segment):
    style = {"lw": 3.0, "color": GREY} if segment.length_m else {"lw": 1.2, "ls": (0, (3, 2)), "color": GREY}
    sheet.line([segment.start, segment.end], zorder=2, **style)
    sheet.take(segment.start, segment.end, 0.8)


def _draw_joint(sheet, place, axis, taken=True):
    """A circle where the axis points into the paper (`axis` None), else a rectangle along the axis."""
    if axis is None:
        sheet.axes.add_patch(Circle(place, RADIUS_MM, fc=JOINT_FACE, ec=BLUE, lw=1.3, zorder=4))
        sheet.axes.add_patch(Circle(place, 0.6, fc=BLUE, ec="none", zorder=4))
        if taken:
            sheet.take(place, place, RADIUS_MM)
        return
    along = axis / np.linalg.norm(axis)
    side = np.array([-along[1], along[0]])
    corners = [place + a * HALF_LENGTH_MM * along + b * HALF_WIDTH_MM * side for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    sheet.axes.add_patch(Polygon(corners, fc=JOINT_FACE, ec=BLUE, lw=1.3, zorder=4))
    ends = place - (HALF_LENGTH_MM + 2.0) * along, place + (HALF_LENGTH_MM + 2.0) * along
    sheet.line(ends, lw=0.8, color=BLUE, ls=(0, (6, 1.5, 1, 1.5)), zorder=5)
    if taken:
        sheet.take(place - 1.6 * along, place + 1.6 * along, HALF_WIDTH_MM)
        sheet.take(*ends, 0.5)


def _point_style(number, smaller=0):
    size = max(2.0, 6.5 - 2.5 * smaller)
    colour, marker = POINT_COLOURS[number % len(POINT_COLOURS)], POINT_MARKERS[number % len(POINT_MARKERS)]
    return {"marker": marker, "ms": size, "mfc": colour, "mec": INK, "mew": 0.6}


def _draw_points(sheet, points):
    for number, point in enumerate(points):
        # Points that share a place are drawn one on the other, each smaller than the one below.
        below = sum(np.allclose(other.place, point.place) for other in points[:number])
        if not np.allclose(point.node, point.place):
            sheet.line([point.node, point.place], lw=0.9, ls=(0, (2, 1.5)), zorder=3)
            sheet.take(point.node, point.place, 0.4)
        sheet.axes.plot(*point.place, zorder=6.5, ls="none", **_point_style(number, below))
        sheet.take(point.place, point.place, 1.4)


def _label_scheme(sheet, segments, joints, points):
    middle = np.mean([s.start for s in segments] + [s.end for s in segments], axis=0)
    for joint in joints:
        away = _outward(joint.place, middle)
        reach = (RADIUS_MM if joint.across else HALF_WIDTH_MM) + 0.3
        sheet.label(_subscripted("q", joint.number), [joint.place], away, (reach, 9.0), f"joint-{joint.number}")
    for number, segment in enumerate((s for s in segments if s.label), start=1):
        anchors = _visible_places(segment)
        along = (segment.end - segment.start) / np.linalg.norm(segment.end - segment.start)
        side = np.array([-along[1], along[0]])
        away = side * (1.0 if side @ (anchors[0] - middle) >= 0 else -1.0)
        sheet.label(segment.label, anchors, away, (1.2, 6.0), f"length-{number}")
    for number, point in enumerate(points):
        colour = POINT_COLOURS[number % len(POINT_COLOURS)]
        sheet.label(point.name, [point.place], _outward(point.place, middle), (8.0, 0.0), f"point-{point.name}", frame=colour)


def _visible_places(segment):
    """Places on a link that no joint covers, those near its middle first."""
    places = [segment.start + part * (segment.end - segment.start) for part in (0.5, 0.6, 0.4, 0.7, 0.3, 0.8, 0.2)]
    covered = [any(np.linalg.norm(joint.place - place) < HALF_LENGTH_MM for joint in segment.carried) for place in places]
    return [place for place, hidden in zip(places, covered, strict=True) if not hidden] or places


def _outward(place, middle):
    distance = np.linalg.norm(place - middle)
    return (place - middle) / distance if distance > 0 else np.array([0.0, 1.0])


def _kinematic_legend(sheet, segments, joints, points, middle, top):
    """Symbols and what they mean, below the drawing; returns where it ends."""
    entries = []
    if any(not joint.across for joint in joints):
        entries.append((lambda p: _draw_joint(sheet, p, np.array([1.0, 0.0]), taken=False), 13.0, "joint, axis in plane"))
    if any(joint.across for joint in joints):
        entries.append((lambda p: _draw_joint(sheet, p, None, taken=False), 8.0, "joint, axis normal to plane"))
    entries.append((lambda p: sheet.axes.plot(*p, ls="none", **_point_style(0)), 4.0, "measuring point"))
    if any(not segment.length_m for segment in segments):
        separator = {"lw": 1.2, "ls": (0, (3, 2)), "color": GREY}
        entries.append((lambda p: sheet.line([(p[0] - 4.0, p[1]), (p[0] + 4.0, p[1])], **separator), 9.0, "no length"))
    bottom = _legend(sheet, entries, middle, top)
    note = "Lengths are not to scale. A joint may be shown moved along its axis."
    sheet.text((middle, bottom - 3.5), note, fontproperties=FONT, color=GREY)
    return bottom - 3.5 - TEXT_HEIGHT_MM / 2


def _legend(sheet, entries, middle, top):
    """Rows of (draw, width of the symbol, text), centred, as many in a row as fit; returns where they end."""
    widths = [symbol + 1.5 + _text_width(text) for _, symbol, text in entries]
    for row in _rows(widths, WIDTH_MM - 2 * MARGIN_MM, gap=LEGEND_GAP_MM):
        x = middle - (sum(widths[i] for i in row) + LEGEND_GAP_MM * (len(row) - 1)) / 2
        for i in row:
            draw, symbol, text = entries[i]
            draw(np.array([x + symbol / 2, top]))
            sheet.text((x + symbol + 1.5, top), text, ha="left")
            x += widths[i] + LEGEND_GAP_MM
        top -= LEGEND_ROW_MM
    return top + LEGEND_ROW_MM - LEGEND_HALF_MM


def _rows(widths, limit, gap):
    """Indices of widths that fill rows one after another."""
    rows, used = [[]], 0.0
    for index, width in enumerate(widths):
        if rows[-1] and used + gap + width > limit:
            rows.append([])
        used = used + gap + width if rows[-1] else width
        rows[-1].append(index)
    return rows


def spring_scheme(robot):
    """Virtual joint model of a robot as a chain of blocks (the paper's Figure 3), drawn from its chain.

    Parameters
    ----------
    robot : Robot
        With `links`, the extended model is drawn below the reduced one.

    Returns
    -------
    matplotlib.figure.Figure
        About 160 mm wide.
    """
    sheet = _Sheet()
    models = [("Reduced model: a 1-DoF spring in each joint", False)]
    if robot.links:
        models.append(("Extended model: also a 6-DoF spring at the end of each link", True))
    top = 0.0
    for title, extended in models:
        sheet.text((-WIDTH_MM / 2 + MARGIN_MM, top), title, ha="left", fontproperties=BOLD)
        top = _draw_model(sheet, _blocks(robot, extended), top - 14.0) - 3.0
    bottom = _spring_legend(sheet, bool(robot.links), top)
    half = WIDTH_MM / 2 - MARGIN_MM
    return sheet.finish((-half, bottom), (half, TEXT_HEIGHT_MM / 2))


@dataclass(frozen=True)
class _Block:
    kind: str
    label: str = ""


THETA = r"\theta"
BLOCK_WIDTHS_MM = {"base": 11.0, "link": 11.0, "actuator": 18.0, "elastic link": 24.0, "end-effector": 17.0}
BLOCK_GAP_MM, LINE_MM, BLOCK_HALF_MM = 3.0, 22.0, 3.6


def _blocks(robot, extended):
    """Base, links and joints in the order of the chain, end-effector."""
    link = "elastic link" if extended else "link"
    blocks, names, lengths = [_Block("base", "Base")], [], 0
    for transform in robot.chain.transforms:
        if transform.kind == "T" and transform.constant != 0:
            lengths += 1
            names.append(_subscripted("l", lengths))
        elif transform.coordinate is not None:
            # All that lies between two joints is one rigid link.
            blocks += [_Block(link, ", ".join(names))] if names else []
            names, number = [], transform.coordinate + 1
            blocks.append(_Block("actuator", f"{_subscripted('q', number)} + {_subscripted(THETA, number)}"))
    blocks += [_Block(link, ", ".join(names))] if names else []
    return [*blocks, _Block("end-effector", "End-\neffector")]


def _draw_model(sheet, blocks, top):
    """Blocks from left to right, in as many lines as they need; returns the height below them."""
    widths = [BLOCK_WIDTHS_MM[block.kind] for block in blocks]
    rows, previous = _even_rows(widths), None
    left = -max(sum(widths[i] + BLOCK_GAP_MM for i in row) for row in rows) / 2
    for row in rows:
        x = left
        if previous is not None:
            _draw_return(sheet, previous, np.array([x, top]))
        for i in row:
            _draw_block(sheet, blocks[i], x, top)
            x += widths[i]
            if i != row[-1]:
                sheet.line([(x, top), (x + BLOCK_GAP_MM, top)], lw=1.2)
            x += BLOCK_GAP_MM
        previous = np.array([x - BLOCK_GAP_MM, top])
        top -= LINE_MM
    return top + LINE_MM - 12.0


def _even_rows(widths):
    """As few rows as possible, the longest of them as short as possible."""
    widest = WIDTH_MM - 2 * MARGIN_MM - 8.0
    rows = _rows(widths, widest, BLOCK_GAP_MM)
    for limit in np.arange(widest, max(widths), -1.0):
        shorter = _rows(widths, limit, BLOCK_GAP_MM)
        if len(shorter) > len(rows):
            break
        rows = shorter
    return rows


def _draw_return(sheet, end, start):
    """From the end of a line of blocks to the start of the next."""
    right, left, between = end[0] + 3.0, start[0] - 3.0, (end[1] + start[1]) / 2
    corners = [end, (right, end[1]), (right, between), (left, between), (left, start[1]), start]
    sheet.line(corners, lw=1.2, solid_joinstyle="round")


def _draw_block(sheet, block, x, y):
    width = BLOCK_WIDTHS_MM[block.kind]
    if block.kind == "base":
        _draw_box(sheet, x, width, y, "white", INK)
        sheet.text((x + width / 2, y), block.label)
        for step in np.arange(x + 1.5, x + width + 0.1, 2.0):
            sheet.line([(step, y - BLOCK_HALF_MM), (step - 1.6, y - BLOCK_HALF_MM - 1.8)], lw=0.7)
    elif block.kind == "end-effector":
        _draw_box(sheet, x, width, y, "white", INK, BLOCK_HALF_MM + 1.0)
        sheet.text((x + width / 2, y), block.label, linespacing=1.0)
    elif block.kind == "actuator":
        _draw_actuator(sheet, x, y)
        _draw_spring(sheet, x + 8.0, x + width, y, ORANGE)
        sheet.text((x + width / 2, y + 6.4), block.label)
    else:
        _draw_box(sheet, x, BLOCK_WIDTHS_MM["link"], y, LINK_FACE, INK)
        sheet.text((x + BLOCK_WIDTHS_MM["link"] / 2, y), "Link")
        sheet.text((x + BLOCK_WIDTHS_MM["link"] / 2, y - 6.2), block.label)
        if block.kind == "elastic link":
            _draw_six_springs(sheet, x + BLOCK_WIDTHS_MM["link"], x + width, y)


def _draw_box(sheet, x, width, y, face, edge, half=BLOCK_HALF_MM):
    corners = [(x, y - half), (x + width, y - half), (x + width, y + half), (x, y + half)]
    sheet.axes.add_patch(Polygon(corners, fc=face, ec=edge, lw=1.0, zorder=3))


def _draw_actuator(sheet, x, y):
    sheet.axes.add_patch(Circle((x + 4.0, y), 4.0, fc=JOINT_FACE, ec=BLUE, lw=1.3, zorder=3))
    sheet.text((x + 4.0, y), "Ac")


def _draw_spring(sheet, start, end, y, colour):
    steps = np.linspace(start + 1.2, end - 1.2, 9)
    heights = y + 2.2 * np.array([0, 1, -1, 1, -1, 1, -1, 1, 0])
    path = [(start, y), *zip(steps, heights, strict=True), (end, y)]
    sheet.line(path, lw=1.4, color=colour, solid_joinstyle="round", zorder=3)


def _draw_six_springs(sheet, start, end, y):
    """One spring in a frame that says it stands for six."""
    start += 1.5
    sheet.line([(start - 1.5, y), (start, y)], lw=1.2)
    box = FancyBboxPatch((start, y - BLOCK_HALF_MM), end - start, 2 * BLOCK_HALF_MM, boxstyle="round,pad=0,rounding_size=1.2")
    box.set(fc="#FBE9DD", ec=RED, lw=1.0, zorder=2.5)
    sheet.axes.add_patch(box)
    _draw_spring(sheet, start, end, y, RED)
    sheet.text(((start + end) / 2, y + 6.4), "6D")


def _spring_legend(sheet, extended, top):
    half = BLOCK_WIDTHS_MM["link"] / 2

    def link(place):
        _draw_box(sheet, place[0] - half, 2 * half, place[1], LINK_FACE, INK)
        sheet.text(place, "Link")

    entries = [
        (lambda p: _draw_actuator(sheet, p[0] - 4.0, p[1]), 8.0, "actuated joint"),
        (lambda p: _draw_spring(sheet, p[0] - 5.0, p[0] + 5.0, p[1], ORANGE), 10.0, "1-DoF spring"),
        (link, 2 * half, "rigid link"),
    ]
    if extended:
        entries.append((lambda p: _draw_six_springs(sheet, p[0] - 7.0, p[0] + 5.5, p[1]), 12.5, "6-DoF spring"))
    return _legend(sheet, entries, 0.0, top - 6.0)
