"""Campaigns of a simulated robot: its schedule, the table of measurements, and rows that
are wrong because of a blunder."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, TypedDict

import numpy as np

from elastocal_proof.plant.arm import Arm, to_rotation_matrix, to_rotation_vector
from elastocal_proof.plant.laws import draw_direction, draw_sign
from elastocal_proof.plant.simulated_robot import (
    Schedule,
    SimulatedRobot,
    Tracker,
    compute_logged_temperature,
    open_simulation_stream,
    simulate_poses,
)

Table = dict[str, np.ndarray]
COVARIATES = ("approach", "time", "temperature")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
_POSE_COLUMNS = ("x", "y", "z", "rx", "ry", "rz")
SECONDS_PER_STATE = 25.0
# From the flange to the point where the force acts, base axes, on arms whose reach is at
# least the second number. Shorter arms have a proportionally shorter lever.
_LEVER_M = (0.0, 0.5, 0.0)
_LONG_REACH_M = 2.5
# Errors of few rows, such as a beam break, a slipped decimal point or a confused sheet.
BLUNDER_KINDS = (
    "position",
    "rotation",
    "joint_angle",
    "load",
    "held_point",
    "zeros",
    "swapped",
)
# Range of the size of a blunder, log-uniform, in standard deviations of the tracker. The
# size of a wrong angle or load is how far it would move a target in the median row.
_MIN_SIZE = 5.0
_MAX_SIZE = 1e5
# The reader of a campaign refuses rows of one pose whose angles differ by more than 0.02
# rad. A larger blunder therefore affects the whole pose, as in a sheet that lists the
# angles of each pose once.
_MAX_SINGLE_ROW_RAD = 0.019
# Upper bound on a wrong load, as a multiple of the largest one.
_MAX_LOAD_FACTOR = 100.0
# A wrong angle is drawn for a joint that moves a target by more than this per radian;
# the step is that of the numerical derivative.
_MIN_LEVER_M = 0.01
_STEP_RAD = 1e-4
# A wrong angle may have to change its sign or to be halved, again and again, to stay
# within the joint limits, because a controller reports no other angles.
_FEASIBLE_SHARES = np.outer(2.0 ** -np.arange(40), [1.0, -1.0]).ravel()


class Blunder(TypedDict):
    """One blunder: its kind, and the rows of the table, from 0, that it made wrong."""

    kind: str
    rows: tuple[int, ...]


@dataclass(frozen=True)
class Design:
    """How a campaign is measured, and which values its table has.

    Attributes
    ----------
    poses, held_out
        Number of poses, and of the last ones that are held out.
    force_times
        Multiple of the typical force of the arm. Each pose has its own random
        direction.
    ladder
        Shares of this force, 0 first; each is a load.
    repeats, repeated_poses
        How often loads 0 and 1 are read at the first poses, and number of these.
    approach_each_load
        Whether the robot moves away and back before each load. Otherwise the loads of a
        pose follow each other without a move.
    points
        Measuring points with a target; empty for all.
    covariates
        Covariates that are written down, of `COVARIATES`.
    declared_noise
        Standard deviations that the campaign claims, m and rad.
    declared
        Effects of the campaign's declared model.
    measured
        "pose" or "position".
    frame
        "base" or "tracker".
    undeclared
        Keys that the analyst's robot file lacks.
    offset_std_m
        Standard deviation of the declared places of the targets; None if the campaign
        does not state it, as most do not.
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
    offset_std_m: float | None = 0.0


def get_typical_force_N(arm: Arm) -> float:  # noqa: N802 - units in names keep their case
    """One kilonewton on arms that carry 140 kg and more, proportionally less on others."""
    return 1000.0 * arm.load_share


def draw_schedule(arm: Arm, design: Design, seed: int) -> Schedule:
    """Draw the states into which a campaign brings a robot."""
    draws = open_simulation_stream(seed, "schedule")
    low, high = arm.limits.T
    angles = low + (high - low) * draws.random((design.poses, arm.joints))
    direction = draws.standard_normal((design.poses, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    states = []
    for pose in range(design.poses):
        states += [(pose, load, 0) for load in range(len(design.ladder))]
        if pose < design.repeated_poses:
            states += [
                (pose, load, repeat)
                for repeat in range(1, design.repeats)
                for load in range(min(2, len(design.ladder)))
            ]
    pose, load, repeat = np.array(states).T
    moved = design.approach_each_load | (load == 0)
    number = np.arange(len(states))
    # Repeats come from the same side, so that they differ by chance and not by
    # friction.
    sense = draws.choice([-1, 1], (design.poses, len(design.ladder), arm.joints))
    force_N = design.force_times * get_typical_force_N(arm)
    lever = min(arm.reach_m / _LONG_REACH_M, 1.0) * np.array(_LEVER_M)
    return Schedule(
        angle=angles[pose],
        force=force_N * np.array(design.ladder)[load, None] * direction[pose],
        lever=np.tile(lever, (len(states), 1)),
        pose=pose,
        load=load,
        repeat=repeat,
        approach=moved.cumsum() - 1,
        sense=sense[pose, load if design.approach_each_load else 0 * load],
        previous=np.where(moved, -1, number - 1),
        time_s=SECONDS_PER_STATE * (number + 1),
        training=pose < design.poses - design.held_out,
        seed=int(seed),
    )


def simulate_measurements(
    robot: SimulatedRobot, design: Design, schedule: Schedule
) -> Table:
    """Simulate the file of measurements: its columns (rows,) by name."""
    position, rotation = robot.tracker.read(
        *simulate_poses(robot, schedule),
        open_simulation_stream(schedule.seed, "readings"),
    )
    if design.frame == "tracker":
        position, rotation = robot.tracker.to_tracker_frame(position, rotation)
    points = design.points or robot.arm.points
    moment = np.cross(schedule.lever, schedule.force)
    columns = {name: getattr(schedule, name) for name in ("pose", "load", "repeat")}
    columns |= _name_columns(_list_joint_columns("q", robot.arm), schedule.angle)
    columns |= _name_columns(WRENCH, np.hstack([schedule.force, moment]))
    if "approach" in design.covariates:
        names = _list_joint_columns("approach", robot.arm)
        columns |= _name_columns(names, schedule.sense.astype(float))
    if "time" in design.covariates:
        columns["time_s"] = schedule.time_s
    if "temperature" in design.covariates:
        columns["temperature_c"] = compute_logged_temperature(schedule.time_s)
    # State by state, because a tracker visits all targets of a state in turn.
    table = {name: np.repeat(column, len(points)) for name, column in columns.items()}
    table["target"] = np.tile(points, len(schedule.pose))
    measurements = np.concatenate([position, to_rotation_vector(rotation)], axis=2)
    indices = [robot.arm.points.index(name) for name in points]
    measured = _POSE_COLUMNS if design.measured == "pose" else _POSE_COLUMNS[:3]
    table |= _name_columns(
        measured, measurements[:, indices, : len(measured)].reshape(-1, len(measured))
    )
    # Adding zero removes minus zeros: products with the zero load, which mean nothing.
    return {
        name: column + 0.0 if column.dtype.kind == "f" else column
        for name, column in table.items()
    }


def _list_joint_columns(name: str, arm: Arm) -> list[str]:
    return [f"{name}{joint}" for joint in range(1, arm.joints + 1)]


def _name_columns(names: Iterable[str], columns: np.ndarray) -> Table:
    return dict(zip(names, columns.T, strict=True))


def add_blunders(
    table: Table,
    robot: SimulatedRobot,
    schedule: Schedule,
    kind: str,
    count: int,
    draws: np.random.Generator,
) -> tuple[Table, list[Blunder]]:
    """Make some rows of a measured table wrong, each of a different pose.

    Parameters
    ----------
    table, robot, schedule
        The table that `simulate_measurements` returns for this robot and schedule.
    kind
        One of `BLUNDER_KINDS`, for columns that the table has.
    count
        Number of blunders; two rows are always swapped.
    draws
        Random numbers.
    """
    rows = _draw_rows(table, kind, 2 if kind == "swapped" else count, draws)
    sizes = _MIN_SIZE * (_MAX_SIZE / _MIN_SIZE) ** draws.random(len(rows))
    wrong_table = {name: column.copy() for name, column in table.items()}
    changed: list[tuple[int, ...]] = [(row,) for row in rows]
    if kind == "joint_angle":
        changed = _change_angles(wrong_table, robot, schedule, rows, sizes, draws)
    elif kind == "load":
        changed = _change_loads(wrong_table, robot, schedule, rows, sizes, draws)
    else:
        names = [name for name in _POSE_COLUMNS if name in table]
        measurements = np.array([table[name] for name in names])
        _spoil_measurements(measurements, kind, rows, sizes, robot.tracker, draws)
        wrong_table |= _name_columns(names, measurements.T)
    return wrong_table, [{"kind": kind, "rows": group} for group in changed]


def _draw_rows(
    table: Table, kind: str, count: int, draws: np.random.Generator
) -> list[int]:
    """Draw rows of different poses in which this kind of blunder is possible."""
    if kind == "load":
        eligible = np.flatnonzero(table["load"])
    else:
        # The first row has no row before it whose point it could repeat.
        eligible = np.arange(kind == "held_point", len(table["pose"]))
    shuffled = draws.permutation(eligible)
    first_of_pose = np.sort(np.unique(table["pose"][shuffled], return_index=True)[1])
    return sorted(shuffled[first_of_pose[:count]].tolist())


def _spoil_measurements(
    measurements: np.ndarray,
    kind: str,
    rows: list[int],
    sizes: np.ndarray,
    tracker: Tracker,
    draws: np.random.Generator,
) -> None:
    """Make measurements (columns, rows) of the tracker wrong in place."""
    if kind == "zeros":
        measurements[:, rows] = 0.0
    elif kind == "held_point":
        measurements[:, rows] = measurements[:, np.array(rows) - 1]
    elif kind == "swapped":
        measurements[:, rows] = measurements[:, rows[::-1]]
    elif kind == "position":
        for row, size in zip(rows, sizes, strict=True):
            measurements[:3, row] += size * tracker.sigma_m * draw_direction(draws)
    else:
        for row, size in zip(rows, sizes, strict=True):
            angle = min(size * tracker.sigma_rad, np.pi)
            turn = to_rotation_matrix(angle * draw_direction(draws))
            rotation = turn @ to_rotation_matrix(measurements[3:, row])
            measurements[3:, row] = to_rotation_vector(rotation)


def _observe_rows(
    table: Table, robot: SimulatedRobot, schedule: Schedule, **changes: Any
) -> np.ndarray:
    """Position (rows, 3) of each row's target under a changed schedule, without
    noise."""
    targets = table["target"]
    points = np.array([robot.arm.points.index(name) for name in targets])
    states = np.arange(len(targets)) // len(np.unique(targets))
    return simulate_poses(robot, replace(schedule, **changes))[0][states, points]


def _change_angles(
    table: Table,
    robot: SimulatedRobot,
    schedule: Schedule,
    rows: list[int],
    sizes: np.ndarray,
    draws: np.random.Generator,
) -> list[tuple[int, ...]]:
    """Make one joint angle wrong for each row; return the rows that this changed."""
    arm = robot.arm
    names = _list_joint_columns("q", arm)
    position = _observe_rows(table, robot, schedule)

    @cache
    def compute_lever_m(joint: int) -> float:
        """How far the joint moves the target of the median row, per radian."""
        angle = schedule.angle + _STEP_RAD * np.eye(arm.joints)[joint]
        shift = _observe_rows(table, robot, schedule, angle=angle) - position
        return float(np.median(np.linalg.norm(shift, axis=1))) / _STEP_RAD

    changed = []
    for row, size in zip(rows, sizes, strict=True):
        for joint in draws.permutation(arm.joints):
            lever_m = compute_lever_m(joint)
            if lever_m > _MIN_LEVER_M:
                break
        error = min(size * robot.tracker.sigma_m / lever_m, np.pi) * draw_sign(draws)
        # Take the first feasible one of these errors, which begin with the largest.
        errors = _FEASIBLE_SHARES * error
        angles = table[names[joint]][row] + errors
        low, high = arm.limits[joint]
        error = errors[np.argmax((angles >= low) & (angles <= high))]
        if abs(error) > _MAX_SINGLE_ROW_RAD:
            same_pose = np.flatnonzero(table["pose"] == table["pose"][row])
            changed.append(tuple(same_pose.tolist()))
        else:
            changed.append(_draw_changed_rows(table, row, draws))
        table[names[joint]][list(changed[-1])] += error
    return changed


def _change_loads(
    table: Table,
    robot: SimulatedRobot,
    schedule: Schedule,
    rows: list[int],
    sizes: np.ndarray,
    draws: np.random.Generator,
) -> list[tuple[int, ...]]:
    """Scale the load of each row, as a slipped decimal point or a wrong unit does, and
    return the rows that this changed."""
    force = np.linalg.norm(schedule.force, axis=1)
    targets = len(np.unique(table["target"]))
    unloaded = _observe_rows(
        table, robot, schedule, force=np.zeros_like(schedule.force)
    )
    shift = np.linalg.norm(_observe_rows(table, robot, schedule) - unloaded, axis=1)
    median_shift_m = float(np.median(shift[table["load"] != 0]))
    changed = []
    for row, size in zip(rows, sizes, strict=True):
        max_share = _MAX_LOAD_FACTOR * force.max() / force[row // targets]
        share = min(size * robot.tracker.sigma_m / median_shift_m, max_share)
        share = share * draw_sign(draws)
        changed.append(_draw_changed_rows(table, row, draws))
        for name in WRENCH:
            table[name][list(changed[-1])] *= 1.0 + share
    return changed


def _draw_changed_rows(
    table: Table, row: int, draws: np.random.Generator
) -> tuple[int, ...]:
    """By chance the row alone, or all targets of the same reading."""
    if draws.integers(2):
        return (row,)
    names = ("pose", "load", "repeat")
    same = np.all([table[name] == table[name][row] for name in names], axis=0)
    return tuple(np.flatnonzero(same).tolist())
