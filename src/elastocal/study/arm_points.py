"""Where on the arm a second target pays (RQ2): each place at an equal number of measurements, and how often it is seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import MeasuringPoint
from elastocal.mechanics.kinematics import corners, poses
from elastocal.study.columns import SET, real, table, text, whole
from elastocal.study.in_memory import ask
from elastocal.study.jobs import rows_as_frame, tabulate
from elastocal.study.points import ratio_of_roots

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    import pandas as pd

    from elastocal.mechanics.chain import Chain
    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.simulation import Experiments

PLACES = table(
    "places",
    whole("joints", "joints that move the target", 1),
    real("along", "m", "way from the base along the chain"),
    text("side", "of the link, the flange, or a bar on the flange"),
    SET,
    real("bound", "m^2", "Cramér-Rao bound with the target beside the end-effector"),
    real("bound_end_effector", "m^2", "the same of the end-effector in twice as many configurations"),
    real("turned", "", "share of configurations in which a tracker sees a reflector turned to it"),
    real("fixed", "", "the same of a reflector that stays as it is"),
)

FLANGE, BAR = "flange", "bar"
_AXES = "xyz"
# Where on a link targets sit, as shares of its length.
_SHARES = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Place:
    """Where a target sits and which way it looks.

    `joints`: how many joints move it. `along_m`: way from the base along the chain. `side`: of the link, as "+y"; or `FLANGE`,
    or `BAR` and the side to which a bar on the flange stands out. `normal`: direction in which it looks, in the frame of the
    point.
    """

    point: MeasuringPoint
    joints: int
    along_m: float
    side: str
    normal: tuple[float, ...]


def places(chain: Chain, radius_m: float, bar_m: float) -> list[Place]:
    """Targets on every side of the links that a joint moves, on the flange, and on a bar that stands out from it.

    `radius_m`: from the axis of a link to its surface; links no longer than this have no place of their own.
    """
    found, joints, along = list[Place](), 0, 0.0
    for index, transform in enumerate(chain.transforms):
        if transform.coordinate is not None:
            joints += 1
        elif transform.kind == "T":
            if joints and abs(transform.constant) > radius_m:
                for share in _SHARES:
                    for side, normal in _sides(transform.axis):
                        way = share * transform.constant * np.eye(3)[transform.axis]
                        offset = tuple((way + radius_m * np.array(normal)).tolist())
                        point = MeasuringPoint(f"{index} {share:g} {side}", index, offset)
                        found.append(Place(point, joints, along + share * abs(transform.constant), side, normal))
            along += abs(transform.constant)
    end = chain.end_effector
    ahead = tuple(np.eye(3)[_last_axis(chain)].tolist())
    found.append(Place(end, joints, along, FLANGE, ahead))
    for side, across in _sides(_last_axis(chain)):
        offset = tuple((np.array(end.offset_m) + bar_m * np.array(across)).tolist())
        found.append(Place(MeasuringPoint(f"{BAR} {side}", end.after, offset), joints, along, f"{BAR} {side}", ahead))
    return found


def in_sight(
    chain: Chain,
    joint_angles: np.ndarray,
    place: Place,
    tracker_m: Sequence[float],
    radius_m: float,
    acceptance_deg: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Whether a target looks towards the tracker and no link stands between, by capsules about the links [1].

    `joint_angles` (N, n). `tracker_m`: base axes. `radius_m`: of the links. `acceptance_deg`: half angle within which a
    reflector that nobody turns gives its beam back. Returns `turned`, `fixed` (N,) of bool: for a reflector that somebody turns
    to the tracker in every configuration, and for one that stays as it is.

    [1] Ericson, C., Real-Time Collision Detection, section 5.1, Morgan Kaufmann, 2005.
    """
    position, rotation = poses(chain, joint_angles, place.point)
    beam = np.array(tracker_m) - position
    cosine = (rotation @ np.array(place.normal) * beam).sum(axis=-1) / np.linalg.norm(beam, axis=-1)
    ends, clear = corners(chain, joint_angles), np.ones(len(joint_angles), bool)
    links = [k for k, t in enumerate(chain.transforms) if t.kind == "T"]
    for start, end, link in zip(ends[:-1], ends[1:], links, strict=True):
        # A target on the surface of a link has this link behind it where it looks towards the tracker.
        own = place.point.after - link in (0, 1)
        if not own and chain.transforms[link].constant:
            clear &= _segment_distances(position, beam, start, end - start) > radius_m
    return clear & (cosine > 0), clear & (cosine > np.cos(np.radians(acceptance_deg)))


def _segment_distances(start: np.ndarray, way: np.ndarray, other: np.ndarray, other_way: np.ndarray) -> np.ndarray:
    """Least distances (N,) of the segments start + s way and other + t other_way, s and t from 0 to 1."""
    between = start - other
    a, e, b = (way * way).sum(-1), (other_way * other_way).sum(-1), (way * other_way).sum(-1)
    c, f = (way * between).sum(-1), (other_way * between).sum(-1)
    parallel = np.maximum(a * e - b * b, 1e-12 * a * e)
    s = np.clip((b * f - c * e) / parallel, 0.0, 1.0)
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    # With t at a bound the best s is another one.
    s = np.clip((b * t - c) / a, 0.0, 1.0)
    return np.linalg.norm(between + s[..., None] * way - t[..., None] * other_way, axis=-1)


def _sides(axis: int) -> list[tuple[str, tuple[float, ...]]]:
    """Names and directions of the four sides of what lies along an axis."""
    found = []
    for other in (k for k in range(3) if k != axis):
        for sign in (1.0, -1.0):
            found.append((f"{'+' if sign > 0 else '-'}{_AXES[other]}", tuple((sign * np.eye(3)[other]).tolist())))
    return found


def _last_axis(chain: Chain) -> int:
    """Axis of the last fixed translation: which way the flange looks."""
    return [t.axis for t in chain.transforms if t.kind == "T" and t.coordinate is None][-1]


def place_columns(study: StudyInMemory, tracker_m: Sequence[float], arm: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Cramér-Rao bounds of the end-effector and a second target, against the end-effector in twice as many configurations.

    `study`: with as many configurations as both are measured in. `arm`: sets, radius_m, bar_m, acceptance_deg; see `places` and
    `in_sight`.
    """
    chain, length, sets = study.robot.chain, study.size.configurations, np.arange(arm["sets"])
    drawn, moment = study.experiments(sets, 2 * length), study.judge().form[:-1, :-1]
    first = drawn.first(length)
    once = _information(study, first, chain.end_effector)
    angles = first.joint_angles.reshape(-1, chain.coordinates)
    scale, columns = study.size.noise**2, []
    alone = scale * _bounds(_information(study, drawn, chain.end_effector), moment)
    for place in places(chain, arm["radius_m"], arm["bar_m"]):
        seen = in_sight(chain, angles, place, tracker_m, arm["radius_m"], arm["acceptance_deg"])
        turned, fixed = (each.reshape(len(sets), length).mean(axis=1) for each in seen)
        both = scale * _bounds(once + _information(study, first, place.point), moment)
        of_place = (np.full(len(sets), each) for each in (place.joints, place.along_m))
        columns.append((*of_place, np.full(len(sets), place.side, object), sets, both, alone, turned, fixed))
    names = [column.name for column in PLACES.columns]
    return {name: np.concatenate(parts) for name, parts in zip(names, zip(*columns, strict=True), strict=True)}


def _information(study: StudyInMemory, experiments: Experiments, point: MeasuringPoint) -> np.ndarray:
    """Sum of A' A (sets, n, n) over the configurations of each data set, from what is measured of a point."""
    rows = study.regressor(experiments, point)[:, :, : study.interpretation.rows]
    flat = rows.reshape(len(rows), -1, rows.shape[-1])
    return flat.swapaxes(1, 2) @ flat


def _bounds(information: np.ndarray, moment: np.ndarray) -> np.ndarray:
    return (np.linalg.inv(information) * moment).sum(axis=(1, 2))


def places_table(found: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """A second target at each place of the arm, against the end-effector in twice as many configurations.

    ratio: of the bounds at as many measurements, with its 95 % interval; the shares of configurations in which a tracker sees
    the target in percent.
    """
    rows = []
    for robot, frame in found.items():
        for (joints, along, side), cell in frame.groupby(["joints", "along", "side"], sort=False):
            ratio = ratio_of_roots(cell.bound.to_numpy(), cell.bound_end_effector.to_numpy())
            rows.append((robot, joints, along, side, *ratio, 100 * cell.turned.mean(), 100 * cell.fixed.mean()))
    head = ("robot", "joints", "along_m", "side", "ratio", "ratio_low", "ratio_high")
    return rows_as_frame(rows, (*head, "seen_turned_percent", "seen_fixed_percent"))


map_arm = ask(PLACES, place_columns)
tabulate_places = tabulate(PLACES, places_table)
