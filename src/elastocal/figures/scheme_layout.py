"""From a robot's chain to places on paper: segments, joints and points of its kinematic scheme."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from elastocal.figures.scheme_sheet import write_subscript

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from elastocal.mechanics.chain import Chain, Transform

# Links after the joints that bend run from this heading to that one, in degrees above the horizontal. Headings that only
# fall, by less than 180 degrees in all, make an arch that cannot meet itself; links that recede can still cross it, so there
# is a choice of arches and of directions on paper, and links count as apart from _ENOUGH_MM on.
_FIRST_HEADING, _LAST_HEADINGS = 70.0, (-45.0, -20.0, 5.0, 30.0)
_ENOUGH_MM = 7.0
DEPTH_RATIO = 0.75
_DEPTH_ANGLES = (*range(45, 66, 5), *range(40, 24, -5), *range(115, 156, 5))
# Directions with a larger cosine between them count as parallel.
PARALLEL = 0.99

# The drawn length of a link: the shortest, more for each joint that is drawn on it, and a part in proportion to its length.
_SHORTEST_MM, _CARRIED_MM = 13.0, 7.0
_SCALES_MM = tuple(range(50, -1, -5))
DRAWING_MM = (100.0, 84.0)


@dataclass
class Segment:
    """A translation as drawn; `length_m` is 0 for one that only separates joints whose axes meet."""

    direction: np.ndarray
    length_m: float
    label: str = ""
    carried: list[Joint] = field(default_factory=list)
    start: np.ndarray = field(init=False, repr=False)
    end: np.ndarray = field(init=False, repr=False)


@dataclass
class Joint:
    """A joint as drawn: on the link that carries it, if one does, else where two links meet."""

    number: int
    axis: np.ndarray
    carrier: Segment | None = None
    place: np.ndarray = field(init=False, repr=False)

    @property
    def across(self) -> bool:
        """Whether its axis points along the line of sight."""
        return abs(self.axis[2]) > PARALLEL


@dataclass
class Point:
    """A measuring point, as drawn away from its node on the chain where it has an offset."""

    name: str
    offset: np.ndarray
    node: np.ndarray = field(init=False, repr=False)
    place: np.ndarray = field(init=False, repr=False)


_Item = Segment | Joint | Point


def lay_out(chain: Chain) -> tuple[list[_Item], np.ndarray]:
    """Everything at its place, and the direction on paper of what recedes.

    Places are in millimetres of paper. The kinematic scheme is a side view with the base's z upwards, in an oblique
    projection: what lies across the view recedes at an angle. Joints across the view are bent so that the links run in an
    arch, the others stay at zero. Lengths are not to scale, so that a link of 41 mm can be seen next to one of 1150 mm.

    Arch and direction are the first choice whose links are apart, else the one that keeps them furthest apart; the scale is
    the largest whose drawing is not larger than DRAWING_MM.
    """
    best = -1.0
    chosen: tuple[list[_Item], np.ndarray]
    for last_heading, angle in product(_LAST_HEADINGS, np.radians(_DEPTH_ANGLES)):
        items = _spread(_walk(chain, last_heading))
        depth = DEPTH_RATIO * np.array([np.cos(angle), np.sin(angle)])
        _place(items, _SCALES_MM[0], depth)
        clearance = _clearance(items)
        if clearance > best + 1e-6:
            best, chosen = clearance, (items, depth)
        if clearance == _ENOUGH_MM:
            break
    items, depth = chosen
    for scale in _SCALES_MM:
        places = _place(items, scale, depth)
        if (np.ptp(places, axis=0) <= DRAWING_MM).all():
            break
    return items, depth


def view_of(chain: Chain) -> np.ndarray:
    """Base axes to (right, up, into the paper), (3, 3): z is up, and most joints that are not about z point into the paper."""
    along = np.zeros(3)
    for transform, frame in zip(chain.transforms, _frames(chain), strict=False):
        if transform.coordinate is not None:
            along += np.abs(frame[:, transform.axis]) > PARALLEL
    if along[0] > along[1]:
        return np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
    return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])


def project_on_paper(vector: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(right, up, into the paper) on paper, (2,), where `depth` (2,) is what a unit into the paper becomes."""
    return vector[:2] + vector[2] * depth


def _frames(chain: Chain) -> list[np.ndarray]:
    """Axes of the moving frame before each transform and after the last, all joints at zero."""
    frames = [np.eye(3)]
    for transform in chain.transforms:
        turns = transform.kind == "R" and transform.coordinate is None
        frames.append(frames[-1] @ _rotation(transform.axis, transform.constant) if turns else frames[-1])
    return frames


def _rotation(axis: int, angle: float) -> np.ndarray:
    matrix = np.eye(3)
    second, third = (axis + 1) % 3, (axis + 2) % 3
    matrix[[second, third], [second, third]] = np.cos(angle)
    matrix[third, second], matrix[second, third] = np.sin(angle), -np.sin(angle)
    return matrix


def _walk(chain: Chain, last_heading: float) -> list[_Item]:
    """Segments, joints and points in the order of the chain, their directions as (right, up, into the paper)."""
    view = view_of(chain)
    frames = [view @ frame for frame in _frames(chain)]
    turns = _turns(chain, frames, last_heading)
    items: list[_Item] = []
    lengths = 0
    for index in range(len(chain.transforms) + 1):
        frame = _rotation(2, turns[index]) @ frames[index]
        items += [Point(p.name, frame @ np.array(p.offset_m)) for p in chain.points if p.after == index]
        if index == len(chain.transforms):
            break
        transform = chain.transforms[index]
        direction = frame[:, transform.axis]
        if transform.kind == "R" and transform.coordinate is not None:
            items.append(Joint(transform.coordinate + 1, direction))
        elif transform.kind == "T" and transform.constant != 0:
            lengths += 1
            label = f"{write_subscript('l', lengths)} = {_millimetres(transform.constant)} mm"
            items.append(Segment(np.sign(transform.constant) * direction, abs(transform.constant), label))
    return items


def _millimetres(length_m: float) -> str:
    return f"{round(1000 * length_m, 1):g}".replace("-", "\N{MINUS SIGN}")


def _turns(chain: Chain, frames: Sequence[np.ndarray], last_heading: float) -> list[float]:
    """Angle in the plane of the paper, before each transform and after the last, by which the joints have turned the frame.

    Only joints across the view turn it, and each such turn shifts the headings of all that follows: so the headings at zero
    are enough to reach the wanted ones. A joint is bent for the longest link before the next one that bends.
    """
    bends = [
        index
        for index, (transform, frame) in enumerate(zip(chain.transforms, frames, strict=False))
        if transform.coordinate is not None and abs(frame[2, transform.axis]) > PARALLEL
    ]
    longest: dict[int, float] = {}
    for index, end in zip(bends, [*bends, len(chain.transforms)][1:], strict=True):
        flat = [_flat_vector(chain.transforms[i], frames[i]) for i in range(index, end)]
        vector = max(flat, key=np.linalg.norm)
        if np.linalg.norm(vector) > 0:
            longest[index] = np.arctan2(vector[1], vector[0])
    wanted = dict(zip(longest, np.radians(np.linspace(_FIRST_HEADING, last_heading, len(longest))), strict=True))
    turns = [0.0]
    for index in range(len(chain.transforms)):
        turns.append(wanted[index] - longest[index] if index in wanted else turns[-1])
    return turns


def _flat_vector(transform: Transform, frame: np.ndarray) -> np.ndarray:
    """What of a translation lies in the plane of the paper."""
    if transform.kind == "R":
        return np.zeros(2)
    return np.round(transform.constant * frame[:2, transform.axis], 9)


def _spread(items: list[_Item]) -> list[_Item]:
    """Joints that share a place, apart: on the links whose direction is their axis, or with a separator between them."""
    spread: list[_Item] = []
    run: list[Joint | Point] = []
    before: Segment | None = None
    if isinstance(_drop_points(items)[0], Joint):
        # A joint in the base's origin would be drawn on the ground.
        items = [Segment(np.array([0.0, 1.0, 0.0]), 0.0), *items]
    for item in [*items, None]:
        if isinstance(item, Segment) or item is None:
            spread += _spread_run(run, before, item)
            run, before = [], item
            spread += [item] if item else []
        else:
            run.append(item)
    return spread


def _drop_points(items: Iterable[_Item]) -> list[Segment | Joint]:
    return [item for item in items if not isinstance(item, Point)]


def _spread_run(run: Sequence[Joint | Point], before: Segment | None, after: Segment | None) -> list[_Item]:
    """Joints and points between two segments; the first joint may move back along its axis, the last one forward."""
    left = [item for item in run if isinstance(item, Joint)]
    if before and left and _turns_about(left[0], before, alone=len(left) == 1):
        _carry(left.pop(0), before)
    if after and left and _turns_about(left[-1], after, alone=len(left) == 1):
        _carry(left.pop(), after)
    spread: list[_Item] = []
    for item in run:
        if before and any(item is joint for joint in left[1:]):
            spread.append(Segment(before.direction, 0.0))
        spread.append(item)
    return spread


def _turns_about(joint: Joint, segment: Segment, alone: bool) -> bool:
    # Across the view a joint is a circle, which looks best at the corner: it moves only to make room for another.
    return abs(joint.axis @ segment.direction) > PARALLEL and not (alone and joint.across)


def _carry(joint: Joint, segment: Segment) -> None:
    joint.carrier = segment
    segment.carried.append(joint)


def _clearance(items: Iterable[_Item]) -> float:
    """Smallest distance between links, up to _ENOUGH_MM; of two that meet, between the halves away from there."""
    segments, nearest = [item for item in items if isinstance(item, Segment)], _ENOUGH_MM
    for (i, one), (j, other) in combinations(enumerate(segments), 2):
        halves = ((0.0, 0.5), (0.5, 1.0)) if j == i + 1 else ((0.0, 1.0), (0.0, 1.0))
        a, b = _samples(one, *halves[0]), _samples(other, *halves[1])
        nearest = min(nearest, np.linalg.norm(a[:, None] - b, axis=2).min())
    return nearest


def _samples(segment: Segment, first: float, last: float) -> np.ndarray:
    return segment.start + np.linspace(first, last, 25)[:, None] * (segment.end - segment.start)


def _place(items: Sequence[_Item], scale: float, depth: np.ndarray) -> np.ndarray:
    """Places on paper of the base's origin and of everything, in millimetres from that origin."""
    longest = max((item.length_m for item in items if isinstance(item, Segment)), default=0.0)
    here, places = np.zeros(3), [np.zeros(2)]
    for item in items:
        place = project_on_paper(here, depth)
        if isinstance(item, Segment):
            item.start = place
            here = here + item.direction * _drawn_length(item, longest, scale)
            item.end = place = project_on_paper(here, depth)
            for number, joint in enumerate(item.carried, start=1):
                joint.place = item.start + (item.end - item.start) * number / (len(item.carried) + 1)
        elif isinstance(item, Point):
            offset = np.linalg.norm(item.offset)
            along = item.offset / offset * (_SHORTEST_MM + 0.3 * scale) if offset else np.zeros(3)
            item.node, item.place = place, project_on_paper(here + along, depth)
            place = item.place
        elif item.carrier is None:
            item.place = place
        places.append(place)
    return np.array(places)


def _drawn_length(segment: Segment, longest: float, scale: float) -> float:
    return _SHORTEST_MM + _CARRIED_MM * len(segment.carried) + scale * (segment.length_m / longest if longest else 0.0)
