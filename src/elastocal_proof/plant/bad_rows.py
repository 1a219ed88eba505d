"""Rows of a measured table that went wrong: what a lost beam, a slipped decimal point or a muddled sheet leave of a few rows.

Sizes are in standard deviations of the tracker: by how much a row contradicts the robot that was measured, its position, or
its orientation where that contradicts more. Of a wrong angle or load it is how far the robot would have stood from where it was
read had it been as the row says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.arm import turned
from elastocal_proof.plant.physical_robot import seen_poses
from elastocal_proof.plant.tracker import rotation_vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule

    Table = dict[str, np.ndarray]

POSITION, ROTATION, JOINT_ANGLE, LOAD = "position", "rotation", "joint_angle", "load"
HELD_POINT, ZEROS, SWAPPED = "held_point", "zeros", "swapped"
KINDS = (POSITION, ROTATION, JOINT_ANGLE, LOAD, HELD_POINT, ZEROS, SWAPPED)
# In standard deviations, evenly in the logarithm.
SMALLEST, LARGEST = 5.0, 1e5
# A campaign's reader refuses rows of one pose whose angles differ by more than 0.02 rad: beyond this the whole pose has the
# angle, as in a sheet that has the angles of each pose once.
_OF_ONE_ROW_RAD = 0.019
# A wrong load is at most so many times the largest one; a joint is drawn among those that move a point by more than this.
_LARGEST_LOAD, _LEVER_M = 100.0, 0.01
_STEP_RAD = 1e-4
_WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
_XYZ, _TURN = ("x", "y", "z"), ("rx", "ry", "rz")


@dataclass(frozen=True)
class BadReading:
    """One slip.

    `rows`: of the table, from 0, in which something wrong stands. `sizes`: of each row; a target that a wrong angle does not
    move has none.
    """

    kind: str
    rows: tuple[int, ...]
    sizes: tuple[float, ...]


def possible_kinds(table: Table) -> tuple[str, ...]:
    """Of `KINDS`: without orientations none can be wrong, without loads no load."""
    absent = {ROTATION: "rx" not in table, LOAD: not table["load"].any()}
    return tuple(kind for kind in KINDS if not absent.get(kind, False))


def with_bad_rows(
    table: Table, robot: PhysicalRobot, schedule: Schedule, kind: str, count: int, draws: np.random.Generator
) -> tuple[Table, list[BadReading]]:
    """A measured table in which some rows, of different poses, are wrong; of swapped ones always two.

    `table`: as `campaigns.measured_table` gives it for this robot and schedule. `kind`: of `possible_kinds`.
    """
    rows = _drawn_rows(table, kind, 2 if kind == SWAPPED else count, draws)
    if kind in (JOINT_ANGLE, LOAD):
        wrong = _with_wrong_angles if kind == JOINT_ANGLE else _with_wrong_loads
        return wrong(table, robot, schedule, rows, draws)
    read = [name for name in (*_XYZ, *_TURN) if name in table]
    bad = {name: column.copy() for name, column in table.items()}
    if kind == ZEROS:
        source = None
    elif kind in (HELD_POINT, SWAPPED):
        source = [row - 1 for row in rows] if kind == HELD_POINT else rows[::-1]
    sizes = _drawn_sizes(len(rows), draws)
    for number, row in enumerate(rows):
        if kind == POSITION:
            _put(bad, _XYZ, row, _at(table, _XYZ, row) + sizes[number] * robot.tracker.sigma_m * _direction(draws))
        elif kind == ROTATION:
            turn = min(sizes[number] * robot.tracker.sigma_rad, np.pi) * _direction(draws)
            _put(bad, _TURN, row, rotation_vector(turned(turn) @ turned(_at(table, _TURN, row))))
        else:
            _put(bad, read, row, np.zeros(len(read)) if source is None else _at(table, read, source[number]))
    return bad, [BadReading(kind, (row,), (_contradicted(robot, table, bad, row),)) for row in rows]


def _drawn_rows(table: Table, kind: str, count: int, draws: np.random.Generator) -> list[int]:
    """Of different poses, rising."""
    some = np.flatnonzero(table["load"]) if kind == LOAD else np.arange(kind == HELD_POINT, len(table["pose"]))
    mixed = draws.permutation(some)
    first = np.sort(np.unique(table["pose"][mixed], return_index=True)[1])[:count]
    return sorted(int(row) for row in mixed[first])


def _drawn_sizes(count: int, draws: np.random.Generator) -> np.ndarray:
    return SMALLEST * (LARGEST / SMALLEST) ** draws.random(count)


def _direction(draws: np.random.Generator) -> np.ndarray:
    vector = draws.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _at(table: Table, names: Sequence[str], row: int) -> np.ndarray:
    return np.array([table[name][row] for name in names])


def _put(table: Table, names: Sequence[str], row: int, values: np.ndarray) -> None:
    for name, value in zip(names, values, strict=True):
        table[name][row] = value


def _contradicted(robot: PhysicalRobot, good: Table, bad: Table, row: int) -> float:
    """Size of what a row says of position and orientation against what was read."""
    away = float(np.linalg.norm(_at(bad, _XYZ, row) - _at(good, _XYZ, row))) / robot.tracker.sigma_m
    if "rx" not in good:
        return away
    turn = turned(_at(bad, _TURN, row)) @ turned(_at(good, _TURN, row)).T
    return max(away, float(np.linalg.norm(rotation_vector(turn))) / robot.tracker.sigma_rad)


def _with_wrong_angles(
    table: Table, robot: PhysicalRobot, schedule: Schedule, rows: Sequence[int], draws: np.random.Generator
) -> tuple[Table, list[BadReading]]:
    arm, names = robot.arm, [f"q{joint}" for joint in range(1, robot.arm.joints + 1)]
    before = seen_poses(robot, schedule)
    at = np.column_stack([_states(table), _points(table, robot)])
    bad, found = {name: column.copy() for name, column in table.items()}, []
    levers: dict[int, float] = {}
    for row, size in zip(rows, _drawn_sizes(len(rows), draws), strict=True):
        for joint in draws.permutation(arm.joints):
            if joint not in levers:
                levers[joint] = _lever_m_per_rad(robot, schedule, before[0], at, int(joint))
            if levers[joint] > _LEVER_M:
                break
        off = min(size * robot.tracker.sigma_m / levers[joint], np.pi) * draws.choice([-1.0, 1.0])
        shown = _at(table, names, row)
        off = _within_limits(robot, shown, int(joint), off)
        wrong = _rows_of_slip(table, row, abs(off) > _OF_ONE_ROW_RAD, draws)
        bad[names[joint]][list(wrong)] += off
        after = arm.angles_shown_as((shown + off * (np.arange(arm.joints) == joint))[None])
        one = _states_of(schedule, at[list(wrong), 0])
        there = seen_poses(robot, replace(one, angle=np.broadcast_to(after, one.angle.shape)))
        found.append(BadReading(JOINT_ANGLE, wrong, tuple(_apart(table, robot, before, there, at[list(wrong)]))))
    return bad, found


def _with_wrong_loads(
    table: Table, robot: PhysicalRobot, schedule: Schedule, rows: Sequence[int], draws: np.random.Generator
) -> tuple[Table, list[BadReading]]:
    """Loads of the same line and another size, as by a slipped decimal point or a wrong unit."""
    before = seen_poses(robot, schedule)
    without = seen_poses(robot, replace(schedule, force=np.zeros_like(schedule.force)))
    at = np.column_stack([_states(table), _points(table, robot)])
    force = np.linalg.norm(schedule.force, axis=1)
    moved = np.linalg.norm(before[0] - without[0], axis=2)[at[:, 0], at[:, 1]]
    usual_m = float(np.median(moved[table["load"] != 0]))
    bad, found = {name: column.copy() for name, column in table.items()}, []
    for row, size in zip(rows, _drawn_sizes(len(rows), draws), strict=True):
        most = _LARGEST_LOAD * force.max() / force[at[row, 0]]
        share = min(size * robot.tracker.sigma_m / usual_m, most) * draws.choice([-1.0, 1.0])
        wrong = _rows_of_slip(table, row, False, draws)
        for name in _WRENCH:
            bad[name][list(wrong)] *= 1.0 + share
        # To first order: no arm would stand under the largest of these.
        states = at[list(wrong), 0]
        there = tuple(part[states] for part in without)
        found.append(BadReading(LOAD, wrong, tuple(abs(share) * _apart(table, robot, before, there, at[list(wrong)]))))
    return bad, found


def _states(table: Table) -> np.ndarray:
    """State of each row: targets of one follow each other."""
    return np.arange(len(table["pose"])) // len(np.unique(table["target"]))


def _points(table: Table, robot: PhysicalRobot) -> np.ndarray:
    return np.array([robot.arm.points.index(name) for name in table["target"]])


def _states_of(schedule: Schedule, states: np.ndarray) -> Schedule:
    arrays = {name: value[states] for name, value in vars(schedule).items() if isinstance(value, np.ndarray)}
    return replace(schedule, **arrays | {"previous": np.full(len(states), -1)})


def _lever_m_per_rad(robot: PhysicalRobot, schedule: Schedule, before: np.ndarray, at: np.ndarray, joint: int) -> float:
    """By how much a joint, as the controller shows it, moves a measured point in the median row."""
    step = robot.arm.reported_matrix[:, joint] * _STEP_RAD
    moved = np.linalg.norm(seen_poses(robot, replace(schedule, angle=schedule.angle + step))[0] - before, axis=2)
    return float(np.median(moved[at[:, 0], at[:, 1]])) / _STEP_RAD


def _within_limits(robot: PhysicalRobot, shown: np.ndarray, joint: int, off: float) -> float:
    """The error, or its opposite, or as much of it as leaves the joints within their limits: a controller shows no others."""
    low, high = robot.arm.limits.T
    for share in (1.0, -1.0, *(sign * 2.0**-power for power in range(1, 40) for sign in (1.0, -1.0))):
        angles = robot.arm.angles_shown_as((shown + share * off * (np.arange(len(shown)) == joint))[None])[0]
        if ((angles >= low) & (angles <= high)).all():
            return share * off
    return 0.0


def _rows_of_slip(table: Table, row: int, whole_pose: bool, draws: np.random.Generator) -> tuple[int, ...]:
    """Rows that got a wrong entry: of the whole pose; or by chance of all targets of one reading, or the row alone."""
    names = ("pose",) if whole_pose else ("pose", "load", "repeat")
    same = np.all([table[name] == table[name][row] for name in names], axis=0)
    alone = not whole_pose and draws.integers(2)
    return (row,) if alone else tuple(int(other) for other in np.flatnonzero(same))


def _apart(
    table: Table, robot: PhysicalRobot, before: tuple[np.ndarray, ...], there: tuple[np.ndarray, ...], at: np.ndarray
) -> np.ndarray:
    """Size of each of some rows, by state and point: how far the poses that they should have had are."""
    number = np.arange(len(at))
    away = np.linalg.norm(there[0][number, at[:, 1]] - before[0][at[:, 0], at[:, 1]], axis=1) / robot.tracker.sigma_m
    if "rx" not in table:
        return away
    turn = there[1][number, at[:, 1]] @ np.swapaxes(before[1][at[:, 0], at[:, 1]], 1, 2)
    turns = np.linalg.norm(rotation_vector(turn), axis=1) / robot.tracker.sigma_rad
    return np.maximum(away, turns)
