"""Rows of a measured table that went wrong: what a lost beam, a slipped decimal point or a muddled sheet leave of a few rows.

How far off they are is drawn in standard deviations of the tracker. Of a wrong angle or load it is how far the robot would have
stood, in the median row, from where it was read had it been as the row says.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal_proof.plant.arm import rotation_vector, turned
from elastocal_proof.plant.campaigns import WRENCH
from elastocal_proof.plant.laws import direction, sign
from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, seen_poses

if TYPE_CHECKING:
    from elastocal_proof.plant.campaigns import Table

    # Its kind, and of the table, from 0, the rows in which something wrong stands.
    Slip = dict[str, Any]

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
# A wrong angle, its opposite, or as much as leaves the joints within their limits: a controller shows no others.
_SHARES = np.outer(2.0 ** -np.arange(40), [1.0, -1.0]).ravel()


def possible_kinds(table: Table) -> tuple[str, ...]:
    """Of `SLIPS`: without orientations none can be wrong, without loads no load."""
    absent = {ROTATION: "rx" not in table, LOAD: not table["load"].any()}
    return tuple(kind for kind in SLIPS if not absent.get(kind, False))


def with_bad_rows(
    table: Table, robot: PhysicalRobot, schedule: Schedule, kind: str, count: int, draws: np.random.Generator
) -> tuple[Table, list[Slip]]:
    """A measured table in which some rows, of different poses, are wrong; of swapped ones always two.

    `table`: as `campaigns.measured_table` gives it for this robot and schedule. `kind`: of `possible_kinds`.
    """
    some = np.flatnonzero(table["load"]) if kind == LOAD else np.arange(kind == HELD_POINT, len(table["pose"]))
    mixed = draws.permutation(some)
    first = np.sort(np.unique(table["pose"][mixed], return_index=True)[1])[: 2 if kind == SWAPPED else count]
    rows = sorted(int(row) for row in mixed[first])
    bad = {name: column.copy() for name, column in table.items()}
    # How far off each row is, in standard deviations.
    sizes = SMALLEST * (LARGEST / SMALLEST) ** draws.random(len(rows))
    if kind in (JOINT_ANGLE, LOAD):
        wrong = _wrong_angles if kind == JOINT_ANGLE else _wrong_loads
        return bad, [{"kind": kind, "rows": found} for found in wrong(bad, robot, schedule, rows, sizes, draws)]
    read = [name for name in ("x", "y", "z", "rx", "ry", "rz") if name in table]
    before = np.array([table[name] for name in read])
    after = before.copy()
    for row, other, size in zip(rows, rows[::-1], sizes, strict=True):
        if kind == POSITION:
            after[:3, row] += size * robot.tracker.sigma_m * direction(draws)
        elif kind == ROTATION:
            turn = min(size * robot.tracker.sigma_rad, np.pi) * direction(draws)
            after[3:, row] = rotation_vector(turned(turn) @ turned(before[3:, row]))
        else:
            after[:, row] = 0.0 if kind == ZEROS else before[:, row - 1 if kind == HELD_POINT else other]
    return bad | dict(zip(read, after, strict=True)), [{"kind": kind, "rows": (row,)} for row in rows]


def _seen(table: Table, robot: PhysicalRobot, schedule: Schedule, **changes: Any) -> np.ndarray:
    """Where a tracker without noise sees each row's target, had the schedule been another."""
    targets = table["target"]
    points = np.array([robot.arm.points.index(name) for name in targets])
    states = np.arange(len(targets)) // len(np.unique(targets))
    return seen_poses(robot, replace(schedule, **changes))[0][states, points]


def _wrong_angles(
    bad: Table, robot: PhysicalRobot, schedule: Schedule, rows: list[int], sizes: np.ndarray, draws: np.random.Generator
) -> list[tuple[int, ...]]:
    arm, names, found = robot.arm, [f"q{joint}" for joint in range(1, robot.arm.joints + 1)], []
    before, levers = _seen(bad, robot, schedule), dict[int, float]()
    for row, size in zip(rows, sizes, strict=True):
        for joint in draws.permutation(arm.joints):
            if joint not in levers:
                # By how much the joint, as the controller shows it, moves a measured point in the median row.
                step = arm.reported_matrix[:, joint] * _STEP_RAD
                moved = np.linalg.norm(_seen(bad, robot, schedule, angle=schedule.angle + step) - before, axis=1)
                levers[joint] = float(np.median(moved)) / _STEP_RAD
            if levers[joint] > _LEVER_M:
                break
        off = _SHARES * min(size * robot.tracker.sigma_m / levers[joint], np.pi) * sign(draws)
        shown = np.tile([bad[name][row] for name in names], (len(off), 1))
        shown[:, joint] += off
        angles = arm.angles_shown_as(shown)
        chosen = off[np.argmax(((angles >= arm.limits[:, 0]) & (angles <= arm.limits[:, 1])).all(axis=1))]
        found.append(_rows_of_slip(bad, row, abs(chosen) > _OF_ONE_ROW_RAD, draws))
        bad[names[joint]][list(found[-1])] += chosen
    return found


def _wrong_loads(
    bad: Table, robot: PhysicalRobot, schedule: Schedule, rows: list[int], sizes: np.ndarray, draws: np.random.Generator
) -> list[tuple[int, ...]]:
    """Loads of the same line and another size, as by a slipped decimal point or a wrong unit."""
    force, targets, found = np.linalg.norm(schedule.force, axis=1), len(np.unique(bad["target"])), []
    without = _seen(bad, robot, schedule, force=np.zeros_like(schedule.force))
    usual_m = float(np.median(np.linalg.norm(_seen(bad, robot, schedule) - without, axis=1)[bad["load"] != 0]))
    for row, size in zip(rows, sizes, strict=True):
        most = _LARGEST_LOAD * force.max() / force[row // targets]
        share = min(size * robot.tracker.sigma_m / usual_m, most) * sign(draws)
        found.append(_rows_of_slip(bad, row, False, draws))
        for name in WRENCH:
            bad[name][list(found[-1])] *= 1.0 + share
    return found


def _rows_of_slip(table: Table, row: int, whole_pose: bool, draws: np.random.Generator) -> tuple[int, ...]:
    """Rows that got a wrong entry: of the whole pose; or by chance of all targets of one reading, or the row alone."""
    names = ("pose",) if whole_pose else ("pose", "load", "repeat")
    same = np.all([table[name] == table[name][row] for name in names], axis=0)
    alone = not whole_pose and draws.integers(2)
    return (row,) if alone else tuple(int(other) for other in np.flatnonzero(same))
