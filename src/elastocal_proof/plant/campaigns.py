"""Campaigns of a physical robot: what is done with it, and the table of what is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.arm import rotation_vector
from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, logged_temperature, read_poses, stream

if TYPE_CHECKING:
    from elastocal_proof.plant.arm import Arm

    Table = dict[str, np.ndarray]

COVARIATES = ("approach", "time", "temperature")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
# Stands for the last measuring point of any arm.
FLANGE = "flange"
SECONDS_PER_STATE = 25.0
# On arms of such a reach a lever of half a metre is usual.
_LONG_M = 2.5


@dataclass(frozen=True)
class Design:
    """How a campaign is made, and what is written down of it.

    `held_out`: the last poses. `force_N`: largest force, of a random direction in each pose; None: what suits the arm;
    `force_times`: how many times that is really meant. `ladder`: shares of it, 0 first: each is a load. `lever_m`: from the
    flange to where the force acts, base axes; shorter in proportion on an arm of less than 2.5 m. `repeats`, `repeated_poses`:
    how often loads 0 and 1 of the first poses are read. `approach_each_load`: whether each load is approached afresh; otherwise
    loads of one pose follow each other without a move. `points`: measuring points with a target each, or `FLANGE`; empty for
    all. `covariates`: which are written down. `declared_noise`: standard deviations that the campaign claims, m and rad.
    `declared`: effects that its model has. `measured`: "pose" or "position". `frame`: "base" or "tracker". `reach`: share of
    the joint limits, about their middle, that poses are drawn from. `undeclared`: keys that the analyst's robot file lacks.
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
    seconds_per_state: float = SECONDS_PER_STATE
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


def lever_of(wrench: np.ndarray) -> np.ndarray:
    """The shortest levers (S, 3) at which the forces of wrenches (S, 6) have their moments, m; none where there is no force."""
    force, moment = wrench[:, :3], wrench[:, 3:]
    square = (force**2).sum(axis=1, keepdims=True)
    return np.divide(np.cross(force, moment), square, out=np.zeros_like(force), where=square > 0)


def schedule_of(arm: Arm, design: Design, seed: int) -> Schedule:
    """Draw what is done."""
    draws = stream(seed, "schedule")
    low, high = arm.limits.T
    angles = low + (high - low) * (0.5 + design.reach * (draws.random((design.poses, arm.joints)) - 0.5))
    direction = draws.standard_normal((design.poses, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    states = [
        (place, rung, again)
        for place in range(design.poses)
        for again in range(design.repeats if place < design.repeated_poses else 1)
        for rung in range(len(design.ladder) if again == 0 else min(2, len(design.ladder)))
    ]
    pose, load, repeat = np.array(states).T
    fresh = design.approach_each_load | (load == 0)
    # A repeat comes from the same side, so that it is one: what differs between repeats is then chance and not friction.
    sense = draws.choice([-1, 1], (design.poses, len(design.ladder), arm.joints))
    largest = design.force_times * (usual_force_N(arm) if design.force_N is None else design.force_N)
    force = largest * np.array(design.ladder)[load, None] * direction[pose]
    number = np.arange(len(states))
    return Schedule(
        angle=angles[pose],
        force=force,
        lever=np.broadcast_to(min(arm.reach_m / _LONG_M, 1.0) * np.array(design.lever_m), force.shape),
        pose=pose,
        load=load,
        repeat=repeat,
        approach=fresh.cumsum() - 1,
        sense=sense[pose, load if design.approach_each_load else 0 * load],
        previous=np.where(fresh, -1, number - 1),
        time_s=design.seconds_per_state * (number + 1),
        training=pose < design.poses - design.held_out,
        seed=int(seed),
    )


def measured_table(robot: PhysicalRobot, design: Design, schedule: Schedule) -> tuple[Table, list[tuple[int, str]]]:
    """Columns of the file of measurements (rows,); and state and target of every measurement that is an outlier."""
    position, rotation, outlier = read_poses(robot, schedule)
    if design.frame == "tracker":
        position, rotation = robot.tracker.in_own_frame(position, rotation)
    points, arm = design.targets_on(robot.arm), robot.arm
    at, joints = [arm.points.index(name) for name in points], range(1, arm.joints + 1)

    def each(column: np.ndarray) -> np.ndarray:
        # State by state, as a tracker goes round its targets.
        return np.repeat(column, len(points), axis=0)

    table = {name: each(getattr(schedule, name)) for name in ("pose", "load", "repeat")}
    table |= {"target": np.tile(points, len(schedule.pose))}
    table |= dict(zip([f"q{j}" for j in joints], each(arm.shown_angles(schedule.angle)).T, strict=True))
    table |= dict(zip(WRENCH, each(schedule.shown_wrench).T, strict=True))
    table |= dict(zip("xyz", position[:, at].reshape(-1, 3).T, strict=True))
    if design.measured == "pose":
        table |= dict(zip(("rx", "ry", "rz"), rotation_vector(rotation[:, at]).reshape(-1, 3).T, strict=True))
    covariates = {
        "approach": dict(zip([f"approach{j}" for j in joints], each(schedule.sense.astype(float)).T, strict=True)),
        "time": {"time_s": each(schedule.time_s)},
        "temperature": {"temperature_c": each(logged_temperature(schedule.time_s))},
    }
    for covariate in design.covariates:
        table |= covariates[covariate]
    # Minus zeros are products of the ladder's zero and mean nothing.
    table = {name: column + 0.0 if column.dtype.kind == "f" else column for name, column in table.items()}
    return table, [(int(state), arm.points[target]) for state, target in np.argwhere(outlier) if target in at]
