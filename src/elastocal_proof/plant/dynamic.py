"""A tracker in its dynamic mode: one target on the flange, read a thousand times a second while the arm moves without a load.

Quasi-static: the arm yields under its own weight and to its drives' errors as at rest, and what acceleration does is left out;
so the path is slow. Deflections change far more slowly than measurements come: they are found at knots and interpolated
between.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from elastocal_proof.plant.campaigns import FLANGE, Design
from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule, at_rest, driven
from elastocal_proof.plant.random_numbers import stream
from elastocal_proof.plant.statics import places

if TYPE_CHECKING:
    from elastocal_proof.plant.arm import Arm

# Waves of each joint's path: how many, and between which periods.
_WAVES, _PERIODS_S = 5, (30.0, 240.0)
_KNOTS_PER_S = 50.0
_AT_ONCE = 50_000

DYNAMIC = Design(points=(FLANGE,), measured="position", covariates=("time",))


def moving_angles(arm: Arm, time_s: np.ndarray, seed: int) -> np.ndarray:
    """A smooth path of all joints within their limits: a few waves of incommensurable periods each.

    `time_s` (S,). Returns (S, n): rad.
    """
    draws = stream(seed, "moving path")
    shape = (_WAVES, arm.joints)
    shortest, longest = np.log(_PERIODS_S)
    frequency = 2.0 * np.pi / np.exp(draws.uniform(shortest, longest, shape))
    phase, weight = draws.uniform(0.0, 2.0 * np.pi, shape), draws.uniform(0.5, 1.0, shape)
    low, high = arm.limits.T
    # Slower waves are the larger ones, so that no joint hurries.
    weight = weight / frequency
    size = 0.5 * (high - low) / weight.sum(axis=0)
    angle = np.empty((len(time_s), arm.joints))
    for part in _parts(len(time_s)):
        waves = np.sin(time_s[part, None, None] * frequency + phase)
        angle[part] = 0.5 * (low + high) + size * (weight * waves).sum(axis=1)
    return angle


def dynamic_table(robot: PhysicalRobot, measurements: int, seed: int, rate_hz: float = 1000.0) -> dict[str, np.ndarray]:
    """Columns of the file of measurements of one uninterrupted path.

    Deflections between knots are interpolated by cubic splines [1].

    `measurements`: of one target; each is a pose of its own. Returns (measurements,): as `campaigns.measured_table` has them:
    pose, load, repeat, target, angles, wrench (nothing), position, time.

    [1] de Boor, C., A Practical Guide to Splines, Springer, 1978.
    """
    arm, time = robot.arm, np.arange(1, measurements + 1) / rate_hz
    angle = moving_angles(arm, time, seed)
    knots = np.linspace(0.0, time[-1], max(int(time[-1] * _KNOTS_PER_S), 8))
    machine, rest = at_rest(robot, _unloaded(moving_angles(arm, knots, seed), knots, seed))
    sprung = np.setdiff1d(np.arange(machine.model.nq), machine.drive)
    deflection = CubicSpline(knots, rest.coordinates[:, sprung])
    position = np.empty((measurements, 1, 3))
    for part in _parts(measurements):
        schedule = _unloaded(angle[part], time[part], seed)
        drive, growth, _, _ = driven(robot, schedule, machine)
        coordinates = np.zeros((len(drive), machine.model.nq))
        coordinates[:, machine.drive], coordinates[:, sprung] = drive, deflection(time[part])
        where = places(machine, coordinates, growth)
        seen = where.position[:, -1:].copy()
        if robot.nest is not None:
            seen[:, 0] = robot.nest.moved(seen[:, 0], where.rotation[:, -1], angle[part, -1])
        position[part] = robot.tracker.seen(seen, where.rotation[:, -1:], time[part])[0]
    facing = np.broadcast_to(np.eye(3), (measurements, 1, 3, 3))
    position = robot.tracker.read(position, facing, stream(seed, "readings"))[0][:, 0]
    shown, count = arm.shown_angles(angle), np.arange(measurements)
    table = {"pose": count, "load": 0 * count, "repeat": 0 * count, "target": np.full(measurements, arm.points[-1])}
    table |= {f"q{joint}": shown[:, joint - 1] for joint in range(1, arm.joints + 1)}
    table |= {name: np.zeros(measurements) for name in ("fx", "fy", "fz", "mx", "my", "mz")}
    return table | dict(zip("xyz", position.T, strict=True)) | {"time_s": time}


def _parts(count: int) -> list[slice]:
    return [slice(start, min(start + _AT_ONCE, count)) for start in range(0, count, _AT_ONCE)]


def _unloaded(angle: np.ndarray, time_s: np.ndarray, seed: int) -> Schedule:
    """A schedule of one long move."""
    nothing = np.zeros(len(angle), int)
    speed = np.gradient(angle, axis=0)
    return Schedule(
        angle,
        np.zeros((len(angle), 3)),
        np.zeros((len(angle), 3)),
        nothing,
        nothing,
        nothing,
        nothing,
        np.sign(speed).astype(int),
        nothing - 1,
        time_s,
        nothing == 0,
        seed,
    )
