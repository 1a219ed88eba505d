"""Campaigns of a physical robot: what is done with it, the table of what is read, and
rows of that which went wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from elastocal_proof.plant.arm import Arm, to_rotation_matrix, to_rotation_vector
from elastocal_proof.plant.laws import draw_direction, draw_sign
from elastocal_proof.plant.simulated_robot import (
    Schedule,
    SimulatedRobot,
    compute_logged_temperature,
    open_simulation_stream,
    simulate_poses,
)

Table = dict[str, np.ndarray]
# Its kind, and of the table, from 0, the rows in which something wrong stands.
Blunder = dict[str, Any]

COVARIATES = ("approach", "time", "temperature")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
_READ = ("x", "y", "z", "rx", "ry", "rz")
SECONDS_PER_STATE = 25.0
# From the flange to where the force acts, base axes, on arms of such a reach.
_LEVER_M = (0.0, 0.5, 0.0)
_LONG_M = 2.5
# What a lost beam, a slipped decimal point or a muddled sheet leave of a few rows.
BLUNDER_KINDS = (
    "position",
    "rotation",
    "joint_angle",
    "load",
    "held_point",
    "zeros",
    "swapped",
)
# How far off, in standard deviations of the tracker, evenly in the logarithm. Of a
# wrong angle or load it is how far the robot would have stood, in the median row, from
# where it was read had it been as the row says.
_SMALLEST = 5.0
_LARGEST = 1e5
# A campaign's reader refuses rows of one pose whose angles differ by more than 0.02
# rad: beyond this the whole pose has the angle, as in a sheet that has the angles of
# each pose once.
_OF_ONE_ROW_RAD = 0.019
# A wrong load is at most so many times the largest one; a joint is drawn among those
# that move a point by more than this.
_LARGEST_LOAD = 100.0
_LEAST_LEVER_M = 0.01
_STEP_RAD = 1e-4
# A wrong angle, its opposite, or as much as leaves the joints within their limits: a
# controller shows no others.
_SHARES = np.outer(2.0 ** -np.arange(40), [1.0, -1.0]).ravel()


@dataclass(frozen=True)
class Design:
    """How a campaign is made, and what is written down of it.

    `held_out`: the last poses. `force_times`: how many times the force is pulled that
    suits the arm, of a random direction in each pose. `ladder`: shares of it, 0 first:
    each is a load. `repeats`, `repeated_poses`: how often loads 0 and 1 of the first
    poses are read. `approach_each_load`: whether each load is approached afresh;
    otherwise loads of one pose follow each other without a move. `points`: measuring
    points with a target each; empty for all. `covariates`: which are written down.
    `declared_noise`: standard deviations that the campaign claims, m and rad.
    `declared`: effects that its model has. `measured`: "pose" or "position". `frame`:
    "base" or "tracker". `undeclared`: keys that the analyst's robot file lacks.
    """

    poses: int = 30
    held_out: int = 9
    force_times: float = 1.0
    ladder: tuple[float, ...] = (0.0, 1.0, 0.5, -0.5, -1.0)
    repeats: int = 4
    repeated_poses: int = 10
    approach_each_load: bool = True
    points: tuple[str, ...] = ()
    covariates: tuple[str, ...] = COVARIATES
    declared_noise: tuple[float, float] | None = None
    declared: tuple[str, ...] = ()
    measured: str = "pose"
    frame: str = "base"
    undeclared: tuple[str, ...] = ()


def get_typical_force_N(arm: Arm) -> float:  # noqa: N802 - units in names keep their case
    """A kilonewton on arms that carry 140 kg and more, and as much less on smaller
    ones."""
    return 1000.0 * arm.load_share


def draw_schedule(arm: Arm, design: Design, seed: int) -> Schedule:
    """Draw what is done."""
    draws = open_simulation_stream(seed, "schedule")
    low, high = arm.limits.T
    angles = low + (high - low) * draws.random((design.poses, arm.joints))
    pull = draws.standard_normal((design.poses, 3))
    pull /= np.linalg.norm(pull, axis=1, keepdims=True)
    states = [
        (place, rung, again)
        for place in range(design.poses)
        for again in range(design.repeats if place < design.repeated_poses else 1)
        for rung in range(
            len(design.ladder) if again == 0 else min(2, len(design.ladder))
        )
    ]
    pose, load, repeat = np.array(states).T
    fresh = design.approach_each_load | (load == 0)
    number = np.arange(len(states))
    # A repeat comes from the same side, so that it is one: what differs between repeats
    # is then chance and not friction.
    sense = draws.choice([-1, 1], (design.poses, len(design.ladder), arm.joints))
    return Schedule(
        angle=angles[pose],
        force=design.force_times
        * get_typical_force_N(arm)
        * np.array(design.ladder)[load, None]
        * pull[pose],
        lever=np.tile(
            min(arm.reach_m / _LONG_M, 1.0) * np.array(_LEVER_M), (len(states), 1)
        ),
        pose=pose,
        load=load,
        repeat=repeat,
        approach=fresh.cumsum() - 1,
        sense=sense[pose, load if design.approach_each_load else 0 * load],
        previous=np.where(fresh, -1, number - 1),
        time_s=SECONDS_PER_STATE * (number + 1),
        training=pose < design.poses - design.held_out,
        seed=int(seed),
    )


def simulate_measurements(
    robot: SimulatedRobot, design: Design, schedule: Schedule
) -> Table:
    """Columns of the file of measurements (rows,)."""
    position, rotation = robot.tracker.read(
        *simulate_poses(robot, schedule),
        open_simulation_stream(schedule.seed, "readings"),
    )
    if design.frame == "tracker":
        position, rotation = robot.tracker.to_tracker_frame(position, rotation)
    points = design.points or robot.arm.points
    at = [robot.arm.points.index(name) for name in points]
    joints = range(1, robot.arm.joints + 1)
    columns = {name: getattr(schedule, name) for name in ("pose", "load", "repeat")}
    columns |= dict(zip([f"q{j}" for j in joints], schedule.angle.T, strict=True))
    columns |= dict(
        zip(
            WRENCH,
            [*schedule.force.T, *np.cross(schedule.lever, schedule.force).T],
            strict=True,
        )
    )
    if "approach" in design.covariates:
        columns |= dict(
            zip(
                [f"approach{j}" for j in joints],
                schedule.sense.T.astype(float),
                strict=True,
            )
        )
    if "time" in design.covariates:
        columns["time_s"] = schedule.time_s
    if "temperature" in design.covariates:
        columns["temperature_c"] = compute_logged_temperature(schedule.time_s)
    # State by state, as a tracker goes round its targets.
    table = {name: np.repeat(column, len(points)) for name, column in columns.items()}
    table["target"] = np.tile(points, len(schedule.pose))
    read = np.concatenate([position, to_rotation_vector(rotation)], axis=2)[
        :, at
    ].reshape(-1, 6)
    table |= dict(
        zip(_READ[: 6 if design.measured == "pose" else 3], read.T, strict=False)
    )
    # Minus zeros are products of the ladder's zero and mean nothing.
    return {
        name: column + 0.0 if column.dtype.kind == "f" else column
        for name, column in table.items()
    }


def add_blunders(
    table: Table,
    robot: SimulatedRobot,
    schedule: Schedule,
    kind: str,
    count: int,
    draws: np.random.Generator,
) -> tuple[Table, list[Blunder]]:
    """A measured table in which some rows, of different poses, are wrong; of swapped
    ones always two.

    `table`: as `measured_table` gives it for this robot and schedule. `kind`: of
    `SLIPS`, and of what the table has.
    """
    some = (
        np.flatnonzero(table["load"])
        if kind == "load"
        else np.arange(kind == "held_point", len(table["pose"]))
    )
    mixed = draws.permutation(some)
    first = np.sort(np.unique(table["pose"][mixed], return_index=True)[1])[
        : 2 if kind == "swapped" else count
    ]
    rows = sorted(int(row) for row in mixed[first])
    bad = {name: column.copy() for name, column in table.items()}
    # How far off each row is, in standard deviations.
    sizes = _SMALLEST * (_LARGEST / _SMALLEST) ** draws.random(len(rows))
    if kind in ("joint_angle", "load"):
        wrong = _wrong_angles if kind == "joint_angle" else _wrong_loads
        return bad, [
            {"kind": kind, "rows": found}
            for found in wrong(bad, robot, schedule, rows, sizes, draws)
        ]
    read = [name for name in _READ if name in table]
    before = np.array([table[name] for name in read])
    after = before.copy()
    for row, other, size in zip(rows, rows[::-1], sizes, strict=True):
        if kind == "position":
            after[:3, row] += size * robot.tracker.sigma_m * draw_direction(draws)
        elif kind == "rotation":
            turn = min(size * robot.tracker.sigma_rad, np.pi) * draw_direction(draws)
            after[3:, row] = to_rotation_vector(
                to_rotation_matrix(turn) @ to_rotation_matrix(before[3:, row])
            )
        else:
            after[:, row] = (
                0.0
                if kind == "zeros"
                else before[:, row - 1 if kind == "held_point" else other]
            )
    return bad | dict(zip(read, after, strict=True)), [
        {"kind": kind, "rows": (row,)} for row in rows
    ]


def _seen(
    table: Table, robot: SimulatedRobot, schedule: Schedule, **changes: Any
) -> np.ndarray:
    """Where a tracker without noise sees each row's target, had the schedule been
    another."""
    targets = table["target"]
    points = np.array([robot.arm.points.index(name) for name in targets])
    states = np.arange(len(targets)) // len(np.unique(targets))
    return simulate_poses(robot, replace(schedule, **changes))[0][states, points]


def _wrong_angles(
    bad: Table,
    robot: SimulatedRobot,
    schedule: Schedule,
    rows: list[int],
    sizes: np.ndarray,
    draws: np.random.Generator,
) -> list[tuple[int, ...]]:
    arm, names, found = (
        robot.arm,
        [f"q{joint}" for joint in range(1, robot.arm.joints + 1)],
        [],
    )
    before = _seen(bad, robot, schedule)
    levers = dict[int, float]()
    for row, size in zip(rows, sizes, strict=True):
        for joint in draws.permutation(arm.joints):
            if joint not in levers:
                # By how much the joint moves a measured point in the median row.
                step = _STEP_RAD * np.eye(arm.joints)[joint]
                moved = np.linalg.norm(
                    _seen(bad, robot, schedule, angle=schedule.angle + step) - before,
                    axis=1,
                )
                levers[joint] = float(np.median(moved)) / _STEP_RAD
            if levers[joint] > _LEAST_LEVER_M:
                break
        off = (
            _SHARES
            * min(size * robot.tracker.sigma_m / levers[joint], np.pi)
            * draw_sign(draws)
        )
        angles = np.tile([bad[name][row] for name in names], (len(off), 1))
        angles[:, joint] += off
        chosen = off[
            np.argmax(
                ((angles >= arm.limits[:, 0]) & (angles <= arm.limits[:, 1])).all(
                    axis=1
                )
            )
        ]
        found.append(_rows_of_slip(bad, row, abs(chosen) > _OF_ONE_ROW_RAD, draws))
        bad[names[joint]][list(found[-1])] += chosen
    return found


def _wrong_loads(
    bad: Table,
    robot: SimulatedRobot,
    schedule: Schedule,
    rows: list[int],
    sizes: np.ndarray,
    draws: np.random.Generator,
) -> list[tuple[int, ...]]:
    """Loads of the same line and another size, as by a slipped decimal point or a wrong
    unit."""
    force = np.linalg.norm(schedule.force, axis=1)
    targets = len(np.unique(bad["target"]))
    found = []
    without = _seen(bad, robot, schedule, force=np.zeros_like(schedule.force))
    usual_m = float(
        np.median(
            np.linalg.norm(_seen(bad, robot, schedule) - without, axis=1)[
                bad["load"] != 0
            ]
        )
    )
    for row, size in zip(rows, sizes, strict=True):
        most = _LARGEST_LOAD * force.max() / force[row // targets]
        share = min(size * robot.tracker.sigma_m / usual_m, most) * draw_sign(draws)
        found.append(_rows_of_slip(bad, row, False, draws))
        for name in WRENCH:
            bad[name][list(found[-1])] *= 1.0 + share
    return found


def _rows_of_slip(
    table: Table, row: int, whole_pose: bool, draws: np.random.Generator
) -> tuple[int, ...]:
    """Rows that got a wrong entry: of the whole pose; or by chance of all targets of
    one reading, or the row alone."""
    names = ("pose",) if whole_pose else ("pose", "load", "repeat")
    same = np.all([table[name] == table[name][row] for name in names], axis=0)
    alone = not whole_pose and draws.integers(2)
    return (row,) if alone else tuple(int(other) for other in np.flatnonzero(same))
