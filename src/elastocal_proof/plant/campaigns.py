"""Campaigns of a physical robot: what is done with it, and the table of what is read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, read_poses
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.tracker import rotation_vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal_proof.plant.arm import Arm

COVARIATES = ("approach", "time", "temperature")
# Stands for the last measuring point of any arm.
FLANGE = "flange"
# On arms of such a reach a lever of half a metre is usual.
_LONG_M = 2.5


@dataclass(frozen=True)
class Design:
    """How a campaign is made, and what is written down of it.

    `held_out`: the last poses, which no step of the analysis may see before its last. `force_N`: largest force; its direction
    is random in each pose. None: what suits the arm, `usual_force_N`. `force_times`: how many times that force is really meant.
    `ladder`: shares of it, 0 first: each is a load. `lever_m`: from the flange to where the force acts, base axes; shorter in
    proportion on an arm of less than 2.5 m. `repeats`, `repeated_poses`: how often loads 0 and 1 of the first poses are read.
    `approach_each_load`: whether each load is approached afresh; otherwise loads of one pose follow each other without a move.
    `points`: measuring points with a target each, or `FLANGE`; empty for all. `covariates`: which of `COVARIATES` are written
    down. `declared_noise` (float, float): standard deviations that the campaign claims, m and rad; right or wrong. `declared`:
    effects that the campaign says its model has. `measured`: one of "pose", "position". `frame`: one of "base", "tracker".
    `reach`: share of the joint limits, about their middle, that poses are drawn from. `undeclared`: keys of the robot file that
    the analyst's lacks.
    """

    poses: int = 30
    held_out: int = 9
    force_N: float | None = None
    force_times: float = 1.0
    ladder: tuple[float, ...] = (0.0, 1.0, 0.5, -0.5, -1.0)
    lever_m: tuple[float, ...] = (0.0, 0.5, 0.0)
    repeats: int = 4
    repeated_poses: int = 10
    approach_each_load: bool = True
    seconds_per_state: float = 25.0
    points: tuple[str, ...] = ()
    covariates: tuple[str, ...] = COVARIATES
    declared_noise: tuple[float, float] | None = None
    declared: tuple[str, ...] = ()
    measured: str = "pose"
    frame: str = "base"
    reach: float = 1.0
    undeclared: tuple[str, ...] = ()

    def targets_on(self, arm: Arm) -> tuple[str, ...]:
        """Names of the measuring points that have a target."""
        return tuple(arm.points[-1] if point == FLANGE else point for point in self.points) or arm.points


def usual_force_N(arm: Arm) -> float:  # noqa: N802 - units in names keep their case
    """A kilonewton on arms that carry 140 kg and more, and as much less on smaller ones."""
    return 1000.0 * arm.load_share


def schedule_of(arm: Arm, design: Design, seed: int) -> Schedule:
    """Draw what is done."""
    draws = stream(seed, "schedule")
    low, high = arm.limits.T
    angles = low + (high - low) * (0.5 + design.reach * (draws.random((design.poses, arm.joints)) - 0.5))
    direction = draws.standard_normal((design.poses, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    states: list[tuple[int, int, int]] = []
    moves: list[int] = []
    previous: list[int] = []
    for place in range(design.poses):
        for again in range(design.repeats if place < design.repeated_poses else 1):
            for rung in range(len(design.ladder) if again == 0 else min(2, len(design.ladder))):
                fresh = design.approach_each_load or rung == 0
                previous.append(-1 if fresh else len(states) - 1)
                moves.append(moves[-1] + fresh if moves else 0)
                states.append((place, rung, again))
    pose, load, repeat = np.array(states).T
    approach = np.array(moves)
    # A repeat comes from the same side, so that it is one: what differs between repeats is then chance and not friction.
    sense = draws.choice([-1, 1], (design.poses, len(design.ladder), arm.joints))
    sense = sense[pose, load if design.approach_each_load else 0 * load]
    largest = design.force_times * (usual_force_N(arm) if design.force_N is None else design.force_N)
    force = largest * np.array(design.ladder)[load, None] * direction[pose]
    lever = np.broadcast_to(min(arm.reach_m / _LONG_M, 1.0) * np.array(design.lever_m), force.shape)
    time = design.seconds_per_state * np.arange(1, len(states) + 1)
    training = pose < design.poses - design.held_out
    return Schedule(
        angles[pose], force, lever, pose, load, repeat, approach, sense, np.array(previous), time, training, int(seed)
    )


def continued(
    schedule: Schedule,
    angle: np.ndarray,
    wrench: np.ndarray,
    seconds_per_state: float = 25.0,
    pause_s: float = 3600.0,
    ladder: Sequence[float] = (0.0, 1.0),
) -> Schedule:
    """A schedule with further states after it, such as a proposed experiment; nothing of what was done before changes.

    `angle` (E, n): rad; equal rows that follow each other are one pose. `wrench` (E, 6): as it shall be shown, N, N m at the
    flange, base axes; the moment is that of the force at a lever. `seconds_per_state`, `pause_s`: pace, and how long after the
    last state the first one comes. `ladder`: shares of its load at which each row is read, 0 first. Returns each further state
    is approached afresh and none is held out. Each new pose starts without a load, as load 0.
    """
    draws = stream(schedule.seed, f"continued after {len(schedule.pose)} states")
    angle, wrench = np.asarray(angle, float), np.asarray(wrench, float)
    new = np.concatenate([[True], (np.diff(angle, axis=0) != 0).any(axis=1)])
    pose = int(schedule.pose.max()) + np.cumsum(new)
    rows: list[tuple[int, float]] = []
    load: list[int] = []
    for row, first in enumerate(new):
        if first:
            rows.append((row, 0.0))
            load.append(0)
        for part in ladder[1:] if wrench[row].any() else ():
            rows.append((row, part))
            load.append(load[-1] + 1)
    state, share = np.array([row for row, _ in rows]), np.array([part for _, part in rows])[:, None]
    force, moment = wrench[state, :3], wrench[state, 3:]
    square = (force**2).sum(axis=1, keepdims=True)
    lever = np.divide(np.cross(force, moment), square, out=np.zeros_like(force), where=square > 0)
    count = np.arange(1, len(state) + 1)
    return replace(
        schedule,
        angle=np.concatenate([schedule.angle, angle[state]]),
        force=np.concatenate([schedule.force, share * force]),
        lever=np.concatenate([schedule.lever, lever]),
        pose=np.concatenate([schedule.pose, pose[state]]),
        load=np.concatenate([schedule.load, np.array(load)]),
        repeat=np.concatenate([schedule.repeat, np.zeros(len(state), int)]),
        approach=np.concatenate([schedule.approach, schedule.approach.max() + count]),
        sense=np.concatenate([schedule.sense, draws.choice([-1, 1], (len(state), angle.shape[1]))]),
        previous=np.concatenate([schedule.previous, np.full(len(state), -1)]),
        time_s=np.concatenate([schedule.time_s, schedule.time_s[-1] + pause_s + seconds_per_state * count]),
        training=np.concatenate([schedule.training, np.ones(len(state), bool)]),
    )


def measured_table(
    robot: PhysicalRobot, design: Design, schedule: Schedule
) -> tuple[dict[str, np.ndarray], list[tuple[int, str]]]:
    """Columns of the file of measurements.

    Returns `table` (rows,); `outliers` (int, str): state and target of every measurement that is one.
    """
    position, rotation, outlier = read_poses(robot, schedule)
    if design.frame == "tracker":
        position, rotation = robot.tracker.in_own_frame(position, rotation)
    arm, shown = robot.arm, robot.arm.shown_angles(schedule.angle)
    joints, wrench = range(1, arm.joints + 1), schedule.shown_wrench
    points = design.targets_on(arm)
    common = {"pose": schedule.pose, "load": schedule.load, "repeat": schedule.repeat}
    after = {f"q{j}": shown[:, j - 1] for j in joints} | dict(zip(("fx", "fy", "fz", "mx", "my", "mz"), wrench.T, strict=True))
    covariates = {
        "approach": {f"approach{j}": schedule.sense[:, j - 1].astype(float) for j in joints},
        "time": {"time_s": schedule.time_s},
        "temperature": {"temperature_c": robot.warmth.shown(schedule.time_s)},
    }
    parts = []
    for name in points:
        target = arm.points.index(name)
        part = common | {"target": np.full(len(wrench), name)} | after | dict(zip("xyz", position[:, target].T, strict=True))
        if design.measured == "pose":
            part |= dict(zip(("rx", "ry", "rz"), rotation_vector(rotation[:, target]).T, strict=True))
        for covariate in design.covariates:
            part |= covariates[covariate]
        parts.append(part)
    table = {column: np.concatenate([part[column] for part in parts]) for column in parts[0]}
    # State by state, as a tracker goes round its targets.
    order = np.argsort(np.tile(np.arange(len(wrench)), len(points)), kind="stable")
    # Minus zeros are products of the ladder's zero and mean nothing.
    table = {name: column[order] + 0.0 if column.dtype.kind == "f" else column[order] for name, column in table.items()}
    return table, [(int(state), arm.points[target]) for state, target in np.argwhere(outlier) if arm.points[target] in points]
