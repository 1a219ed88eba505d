"""Checks of measurements as a whole: what can be recognised as wrong in them without fitting anything."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from elastocal.campaigns.campaign import Measurements, Target
from elastocal.campaigns.groups import groups_of
from elastocal.campaigns.holdout import measured_poses
from elastocal.campaigns.joint_space import SAME_POSE_RAD
from elastocal.campaigns.measurements import FARTHEST_RAD, MeasurementFile
from elastocal.errors import InputError
from elastocal.mechanics.robot import Robot

# From pose to pose, in an order that has nothing to do with the time, it falls as often as not: in more than this share of at
# least so many steps with a probability of one in 700 at most.
_BACKWARDS, _FEWEST_IN_ORDER = 0.875, 5
# A joint this far beyond its limits is no joint at its limit.
_BEYOND_LIMITS_RAD = 0.5
# A unit is wrong in a whole file. What is off in fewer rows than this is a gross error of theirs, which the diagnosis names.
_SINGLE_ROWS = 0.2
# Positions spread over more reaches than this are not in metres. Millimetres spread so unless all lie within centimetres.
_FARTHEST_REACHES = 10.0
# A target sits at most about this far from its measuring point.
_LONGEST_TOOL_M = 1.0


def find_degrees(reported: np.ndarray, robot: Robot) -> np.ndarray:
    """Angles that look like degrees: more turns than a joint has, or far beyond limits that a 57th of the angle keeps.

    `reported` (N, n): joint angles as the controller reports them. Returns (N, n) of bool.
    """
    low, high = robot.joint_limits.T
    farthest = max(FARTHEST_RAD, np.abs(robot.joint_limits).max())

    def inside(reported: np.ndarray, margin: float = 0.0) -> np.ndarray:
        angles = robot.model_angles(reported)
        return (angles >= low - margin) & (angles <= high + margin)

    # An angle that its opposite would bring inside the limits has rather a wrong sign, which is for the diagnosis to trace.
    beyond = ~inside(reported, _BEYOND_LIMITS_RAD) & ~inside(-reported, _BEYOND_LIMITS_RAD)
    return np.asarray((np.abs(reported) > farthest) | (beyond & inside(np.radians(reported))))


def check_angles(reported: np.ndarray, table: MeasurementFile, robot: Robot) -> None:
    """Refuse degrees in more than single rows.

    `reported` (N, n): joint angles as the controller reports them. Raises `InputError`: the first such angle.
    """
    low, high = robot.joint_limits.T
    wrong = find_degrees(reported, robot)
    if wrong.any(axis=1).mean() > _SINGLE_ROWS:
        index, joint = np.argwhere(wrong)[0]
        allowed = (
            f"rad, not degrees, of a joint that goes from {low[joint]:.2f} to {high[joint]:.2f} rad"
            " (counted otherwise: reported_joints of the robot file)"
        )
        raise table.cell_fault(index, table.angles[joint], f"{reported[index, joint]:g}", allowed)


def check_measurements(
    measurements: Measurements, table: MeasurementFile, robot: Robot, targets: Sequence[Target], source: str
) -> None:
    """Refuse measurements that cannot be of one campaign in the units of the format.

    `table`: where they were read from. `source`: document of the campaign, named in errors of what is not in the table. Raises
    `InputError`: the first fault: a measurement that is there twice, a load that contradicts its wrench, a pose at two places,
    times that run backwards, millimetres or degrees, a target without a measurement.
    """
    _check_duplicates(measurements, table, targets)
    _check_loads(measurements, table)
    _check_poses(measurements, table)
    _check_times(measurements, table)
    _check_units(measurements, table, robot, targets)
    for index, target in enumerate(targets):
        if not (measurements.target == index).any():
            allowed = f"targets that {Path(table.path).name} has measurements of"
            raise InputError(source, f"targets.{target.name}", "no measurement of it", allowed)


def _check_duplicates(measurements: Measurements, table: MeasurementFile, targets: Sequence[Target]) -> None:
    key = np.column_stack(
        [measurements.session, measurements.pose, measurements.load, measurements.repeat, measurements.target]
    )
    first, group = groups_of(key)
    again = first[group] != np.arange(len(measurements))
    if again.any():
        index = int(np.argmax(again))
        session, pose, load, repeat, target = key[index]
        of_session = f"session {session}, " if "session" in table.columns else ""
        found = f"{of_session}pose {pose}, load {load}, repeat {repeat}, target {targets[target].name} again"
        earlier = table.rows[first[group[index]]]
        raise table.cell_fault(index, "", found, f"each once (first in row {earlier})")


def _check_loads(measurements: Measurements, table: MeasurementFile) -> None:
    unloaded = measurements.load == 0
    if not table.has(table.wrench) and not unloaded.all():
        index = int(np.argmin(unloaded))
        allowed = f"0 where there are no columns {', '.join(table.wrench)}"
        raise table.cell_fault(index, "load", str(measurements.load[index]), allowed)
    wrong = unloaded[:, None] & (measurements.wrench != 0)
    if wrong.any():
        index, component = np.argwhere(wrong)[0]
        found = f"{measurements.wrench[index, component]:g} with load 0"
        raise table.cell_fault(index, table.wrench[component], found, "0 where load is 0")


def _check_poses(measurements: Measurements, table: MeasurementFile) -> None:
    pose_of = measured_poses(measurements)[1]
    first = np.unique(pose_of, return_index=True)[1]
    reported = table.numbers(table.angles)
    away = np.abs(reported - reported[first[pose_of]])
    wrong = away > SAME_POSE_RAD
    if wrong.any():
        index, joint = np.argwhere(wrong)[0]
        earlier = table.rows[first[pose_of[index]]]
        found = f"{reported[index, joint]:g}, {away[index, joint]:.3g} rad from row {earlier} of the same pose"
        raise table.cell_fault(index, table.angles[joint], found, f"measurements of one pose within {SAME_POSE_RAD} rad")


def _check_times(measurements: Measurements, table: MeasurementFile) -> None:
    """Refuse a clock that runs backwards: in a session times fall from pose to pose, by their numbers and as they stand.

    Poses may be measured in another order than that of their numbers, and stand in any order in the file: one of the two alone
    says nothing of the clock.
    """
    if measurements.time_s is None:
        return
    pairs, pose_of = measured_poses(measurements)
    first, begun = np.unique(pose_of, return_index=True)[1], np.full(len(pairs), np.inf)
    np.minimum.at(begun, pose_of, measurements.time_s)
    for session in np.unique(pairs[:, 0]):
        members = np.flatnonzero(pairs[:, 0] == session)
        falling = [np.diff(begun[members[order]]) < 0 for order in (slice(None), np.argsort(first[members]))]
        if len(members) > _FEWEST_IN_ORDER and all(each.mean() > _BACKWARDS for each in falling):
            last = members[np.argmax(first[members])]
            found = f"{begun[last]:.15g}, when the poses before it were measured later"
            raise table.cell_fault(int(first[last]), "time_s", found, "times that rise from pose to pose: s since any instant")


def _check_units(measurements: Measurements, table: MeasurementFile, robot: Robot, targets: Sequence[Target]) -> None:
    tool = max((np.linalg.norm(target.offset_m) for target in targets if target.offset_m is not None), default=_LONGEST_TOOL_M)
    reach = tool + sum(abs(transform.constant) for transform in robot.chain.transforms if transform.kind == "T")
    for session in np.unique(measurements.session):
        members = np.flatnonzero(measurements.session == session)
        position = measurements.position[members]
        away = np.abs(position - np.median(position, axis=0))
        if np.quantile(away.max(axis=1), 1.0 - _SINGLE_ROWS) > _FARTHEST_REACHES * reach:
            index, axis = np.unravel_index(np.argmax(away), away.shape)
            found = f"{position[index, axis]:g}, {away[index, axis]:.4g} from the middle of the measurements"
            allowed = f"metres, not millimetres; the robot reaches {reach:.3g} m"
            raise table.cell_fault(members[index], "xyz"[axis], found, allowed)
    if measurements.rotation_vector is not None:
        angle = np.linalg.norm(measurements.rotation_vector, axis=1)
        if angle.max() > FARTHEST_RAD:
            turned = int(np.argmax(angle))
            allowed = f"a rotation vector in rad, not degrees, {FARTHEST_RAD:.3g} at most"
            raise table.cell_fault(turned, "rx, ry, rz", f"a turn of {angle[turned]:.4g}", allowed)
