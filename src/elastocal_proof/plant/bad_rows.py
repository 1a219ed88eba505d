"""Rows of a measured table that went wrong: what a lost beam, a slipped decimal point or a muddled sheet leave of a few rows.

Sizes are in standard deviations of the tracker: by how much a row contradicts the robot that was measured, its position, or
its orientation where that contradicts more. Of a wrong angle or load it is how far the robot would have stood from where it was
read had it been as the row says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal_proof.plant.arm import rotation_vector, turned
from elastocal_proof.plant.campaigns import WRENCH
from elastocal_proof.plant.kinds import direction
from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, seen_poses

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal_proof.plant.campaigns import Table

POSITION, ROTATION, JOINT_ANGLE, LOAD = "position", "rotation", "joint_angle", "load"
HELD_POINT, ZEROS, SWAPPED = "held_point", "zeros", "swapped"
SLIPS = (POSITION, ROTATION, JOINT_ANGLE, LOAD, HELD_POINT, ZEROS, SWAPPED)
# In standard deviations, evenly in the logarithm.
SMALLEST, LARGEST = 5.0, 1e5
# A campaign's reader refuses rows of one pose whose angles differ by more than 0.02 rad: beyond this the whole pose has the
# angle, as in a sheet that has the angles of each pose once.
_OF_ONE_ROW_RAD = 0.019
# A wrong load is at most so many times the largest one; a joint is drawn among those that move a point by more than this.
_LARGEST_LOAD, _LEVER_M, _STEP_RAD = 100.0, 0.01, 1e-4
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
    """Of `SLIPS`: without orientations none can be wrong, without loads no load."""
    absent = {ROTATION: "rx" not in table, LOAD: not table["load"].any()}
    return tuple(kind for kind in SLIPS if not absent.get(kind, False))


def with_bad_rows(
    table: Table, robot: PhysicalRobot, schedule: Schedule, kind: str, count: int, draws: np.random.Generator
) -> tuple[Table, list[BadReading]]:
    """A measured table in which some rows, of different poses, are wrong; of swapped ones always two.

    `table`: as `campaigns.measured_table` gives it for this robot and schedule. `kind`: of `possible_kinds`.
    """
    some = np.flatnonzero(table["load"]) if kind == LOAD else np.arange(kind == HELD_POINT, len(table["pose"]))
    mixed = draws.permutation(some)
    first = np.sort(np.unique(table["pose"][mixed], return_index=True)[1])[: 2 if kind == SWAPPED else count]
    rows = sorted(int(row) for row in mixed[first])
    if kind == JOINT_ANGLE:
        return _with_wrong_angles(table, _Truth(table, robot, schedule), rows, draws)
    if kind == LOAD:
        return _with_wrong_loads(table, _Truth(table, robot, schedule), rows, draws)
    read, tracker = [name for name in (*_XYZ, *_TURN) if name in table], robot.tracker
    bad, sizes, found = _copied(table), _drawn_sizes(len(rows), draws), []
    for row, other, size in zip(rows, rows[::-1], sizes, strict=True):
        if kind == POSITION:
            _put(bad, _XYZ, row, _at(table, _XYZ, row) + size * tracker.sigma_m * direction(draws))
        elif kind == ROTATION:
            turn = min(size * tracker.sigma_rad, np.pi) * direction(draws)
            _put(bad, _TURN, row, rotation_vector(turned(turn) @ turned(_at(table, _TURN, row))))
        elif kind == ZEROS:
            _put(bad, read, row, np.zeros(len(read)))
        else:
            _put(bad, read, row, _at(table, read, row - 1 if kind == HELD_POINT else other))
        poses = ((_at(each, _XYZ, row), turned(_at(each, _TURN, row)) if "rx" in each else np.eye(3)) for each in (bad, table))
        found.append(BadReading(kind, (row,), (float(_apart(robot, *poses)),)))
    return bad, found


@dataclass(frozen=True)
class _Truth:
    """The plant behind a table: states of one target follow each other, and poses are those of a tracker without noise."""

    table: Table
    robot: PhysicalRobot
    schedule: Schedule

    def at(self, rows: Sequence[int] | slice = slice(None)) -> tuple[np.ndarray, np.ndarray]:
        """State and measuring point of rows."""
        targets = self.table["target"]
        points = np.array([self.robot.arm.points.index(name) for name in targets])
        return (np.arange(len(targets)) // len(np.unique(targets)))[rows], points[rows]

    def seen(self, **changes: Any) -> tuple[np.ndarray, np.ndarray]:
        """Poses of each row."""
        states, points = self.at()
        position, rotation = seen_poses(self.robot, replace(self.schedule, **changes))
        return position[states, points], rotation[states, points]

    def seen_at(self, rows: Sequence[int], angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Poses of some rows had the robot stood at other angles (n,)."""
        states, points = self.at(rows)
        arrays: dict[str, Any] = {
            name: value[states] for name, value in vars(self.schedule).items() if isinstance(value, np.ndarray)
        }
        arrays |= {"previous": np.full(len(states), -1), "angle": np.broadcast_to(angle, (len(states), len(angle)))}
        position, rotation = seen_poses(self.robot, replace(self.schedule, **arrays))
        number = np.arange(len(states))
        return position[number, points], rotation[number, points]

    def apart(self, there: tuple[np.ndarray, ...], before: tuple[np.ndarray, ...]) -> np.ndarray:
        """Sizes of rows, of which the orientation counts where it was read."""
        sizes = _apart(self.robot, there, before if "rx" in self.table else (before[0], there[1]))
        return np.asarray(sizes)


def _with_wrong_angles(
    table: Table, true: _Truth, rows: Sequence[int], draws: np.random.Generator
) -> tuple[Table, list[BadReading]]:
    arm, names = true.robot.arm, [f"q{joint}" for joint in range(1, true.robot.arm.joints + 1)]
    before, bad, found = true.seen(), _copied(table), []
    levers: dict[int, float] = {}
    for row, size in zip(rows, _drawn_sizes(len(rows), draws), strict=True):
        for joint in draws.permutation(arm.joints):
            if joint not in levers:
                # By how much the joint, as the controller shows it, moves a measured point in the median row.
                step = arm.reported_matrix[:, joint] * _STEP_RAD
                moved = np.linalg.norm(true.seen(angle=true.schedule.angle + step)[0] - before[0], axis=1)
                levers[joint] = float(np.median(moved)) / _STEP_RAD
            if levers[joint] > _LEVER_M:
                break
        off = min(size * true.robot.tracker.sigma_m / levers[joint], np.pi) * draws.choice([-1.0, 1.0])
        shown, turn = _at(table, names, row), (np.arange(arm.joints) == joint).astype(float)
        # Or its opposite, or as much as leaves the joints within their limits: a controller shows no others.
        for share in (1.0, -1.0, *(sign * 2.0**-power for power in range(1, 40) for sign in (1.0, -1.0))):
            angles = arm.angles_shown_as((shown + share * off * turn)[None])[0]
            if ((angles >= arm.limits[:, 0]) & (angles <= arm.limits[:, 1])).all():
                break
        off = share * off
        wrong = list(_rows_of_slip(table, row, abs(off) > _OF_ONE_ROW_RAD, draws))
        bad[names[joint]][wrong] += off
        sizes = true.apart(true.seen_at(wrong, angles), tuple(part[wrong] for part in before))
        found.append(BadReading(JOINT_ANGLE, tuple(wrong), tuple(sizes.tolist())))
    return bad, found


def _with_wrong_loads(
    table: Table, true: _Truth, rows: Sequence[int], draws: np.random.Generator
) -> tuple[Table, list[BadReading]]:
    """Loads of the same line and another size, as by a slipped decimal point or a wrong unit."""
    before, without = true.seen(), true.seen(force=np.zeros_like(true.schedule.force))
    force, sigma = np.linalg.norm(true.schedule.force, axis=1), true.robot.tracker.sigma_m
    usual_m = float(np.median(np.linalg.norm(before[0] - without[0], axis=1)[table["load"] != 0]))
    bad, found = _copied(table), []
    for row, size in zip(rows, _drawn_sizes(len(rows), draws), strict=True):
        most = _LARGEST_LOAD * force.max() / force[true.at([row])[0][0]]
        share = min(size * sigma / usual_m, most) * draws.choice([-1.0, 1.0])
        wrong = list(_rows_of_slip(table, row, False, draws))
        for name in WRENCH:
            bad[name][wrong] *= 1.0 + share
        # To first order: no arm would stand under the largest of these.
        sizes = abs(share) * true.apart(tuple(part[wrong] for part in without), tuple(part[wrong] for part in before))
        found.append(BadReading(LOAD, tuple(wrong), tuple(sizes.tolist())))
    return bad, found


def _copied(table: Table) -> Table:
    return {name: column.copy() for name, column in table.items()}


def _drawn_sizes(count: int, draws: np.random.Generator) -> np.ndarray:
    return SMALLEST * (LARGEST / SMALLEST) ** draws.random(count)


def _at(table: Table, names: Sequence[str], row: int) -> np.ndarray:
    return np.array([table[name][row] for name in names])


def _put(table: Table, names: Sequence[str], row: int, values: np.ndarray) -> None:
    for name, value in zip(names, values, strict=True):
        table[name][row] = value


def _apart(robot: PhysicalRobot, there: tuple[np.ndarray, ...], before: tuple[np.ndarray, ...]) -> np.ndarray:
    """How far poses, positions (..., 3) and rotations (..., 3, 3), are from others, (...), in standard deviations."""
    away = np.linalg.norm(there[0] - before[0], axis=-1) / robot.tracker.sigma_m
    turn = rotation_vector(there[1] @ np.swapaxes(before[1], -1, -2))
    return np.maximum(away, np.linalg.norm(turn, axis=-1) / robot.tracker.sigma_rad)


def _rows_of_slip(table: Table, row: int, whole_pose: bool, draws: np.random.Generator) -> tuple[int, ...]:
    """Rows that got a wrong entry: of the whole pose; or by chance of all targets of one reading, or the row alone."""
    names = ("pose",) if whole_pose else ("pose", "load", "repeat")
    same = np.all([table[name] == table[name][row] for name in names], axis=0)
    alone = not whole_pose and draws.integers(2)
    return (row,) if alone else tuple(int(other) for other in np.flatnonzero(same))
