"""Defects that the catalogue does not have, as functions of robot, size, draws of their details, and joints from 0."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal_proof.plant.kinds import (
    OUTSIDE,
    TURN,
    Applied,
    Draws,
    built,
    driven,
    each_joint,
    each_link,
    geared,
    kind,
    nowhere,
    sign,
    stiff_by_angle,
    waving,
)
from elastocal_proof.plant.machine import TaperedTube

if TYPE_CHECKING:
    from elastocal_proof.plant.physical_robot import PhysicalRobot, Schedule


@kind(OUTSIDE + "cable_pull", "rad/rad^2", 1e-4, lambda arm: [(j,) for j in range(3, arm.joints)])
def cable_pull(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A hose wound by its joint and the one before pulls in proportion to the product of the two angles."""
    size = size * sign(draws)
    return driven(robot, joint, lambda done: size * done.angle[:, joint - 1] * done.angle[:, joint]), {}


@kind(OUTSIDE + "two_angles", "rad", 2e-4, lambda arm: [(j,) for j in range(2, arm.joints)])
def two_angles(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A gear whose wave goes once round as its own joint and the one behind it turn, in step or against each other."""
    sense, phase = sign(draws), draws.uniform(0, TURN)
    return driven(robot, joint, lambda done: size * np.sin(done.angle[:, joint] + sense * done.angle[:, joint + 1] + phase)), {}


@kind(OUTSIDE + "cable_transmission", "rad/(N m)", 1e-7, lambda arm: [(j,) for j in range(2, arm.joints)], scale=(1.0, 0.0))
def cable_transmission(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Cables from the motor over the joint before: theta = s (tau (1 + f q / pi) + tau_o / 2).

    They yield to the tension of their joint as their free length, which falls or grows by a share f as it winds, and to that of
    the joint o behind it, whose pulley they pass.
    """
    winding = draws.uniform(0.4, 0.8) * sign(draws)

    def turn(done: Schedule, torque: np.ndarray, _: np.ndarray) -> np.ndarray:
        free = 1.0 + winding * done.angle[:, joint] / np.pi
        return size * (torque[:, joint] * free + 0.5 * torque[:, joint + 1])

    return replace(robot, gears=(*robot.gears, (joint, turn))), {}


@kind(OUTSIDE + "asymmetric_gear", "rad/(N m)^2", 1e-10, each_joint, scale=(1.0, -1.0))
def asymmetric_gear(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Flanks of unlike shape: theta = k tau^2, alike for both signs of the torque."""
    size = size * sign(draws)
    return geared(robot, joint, lambda _, torque: size * torque**2), {}


@kind(OUTSIDE + "slipping_zero", "rad", 5e-5, each_joint)
def slipping_zero(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A coupling that slips a little at three of ten moves: a random walk from approach to approach, numbered in time."""

    def walk(done: Schedule) -> np.ndarray:
        sizes, whether = (np.random.default_rng([done.seed, 7, part]) for part in range(2))
        number = int(done.approach.max()) + 1
        return np.cumsum(size * sizes.standard_normal(number) * (whether.random(number) < 0.3))[done.approach]

    return driven(robot, joint, walk), {}


@kind(OUTSIDE + "warm_softening", "1/K", 0.01, each_joint)
def warm_softening(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A gear that softens as it warms: theta = c r (T - 20 °C) tau."""
    softer, warmth = size * robot.compliance[joint], robot.warmth
    return geared(robot, joint, lambda done, torque: softer * warmth.of_castings(done.time_s) * torque), {}


# A parallel rod: the stiffness of the shoulder depends on the angle of the elbow, or the other way round.
kind(OUTSIDE + "foreign_angle_stiffness", "1", 0.15, lambda arm: [(2,), (3,)], largest=0.8)(
    lambda robot, size, draws, joint: (stiff_by_angle(robot, joint, 3 - joint, size, draws.uniform(0, TURN)), {})
)


@kind(OUTSIDE + "stiffening_link", "rad/(N m)^3", 1e-13, each_link, scale=(1.0, -2.0))
def stiffening_link(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """A bolted link whose flanges open with the cube of the bending moment; without it the link is rigid."""
    pieces = robot.structure.segments
    changed = built(robot, tubes=robot.structure.tubes | {joint + 1: TaperedTube(np.inf, np.inf)})
    laws = tuple((f"link{joint + 1}_{piece}_bend", lambda moment: size * moment**3 / pieces) for piece in range(pieces))
    return replace(changed, structure_laws=(*robot.structure_laws, *laws)), {}


@kind(OUTSIDE + "foot_slip", "m", 8e-5, nowhere)
def foot_slip(robot: PhysicalRobot, size: float, draws: Draws) -> Applied:
    """A foot between its bolts: it shifts by a clearance as soon as the push exceeds friction, and no further."""
    friction = draws.uniform(100.0, 300.0) * robot.arm.load_share

    def slip(push: np.ndarray) -> np.ndarray:
        return size * np.sign(push) * np.clip((np.abs(push) - friction) / friction, 0.0, 1.0)

    laws = (("base_x", slip), ("base_y", slip))
    return replace(built(robot, base=(0.0,) * 6), structure_laws=(*robot.structure_laws, *laws)), {}


kind(OUTSIDE + "refraction", "1/m", 2e-6, nowhere)(
    lambda robot, size, draws: (replace(robot, tracker=replace(robot.tracker, refraction_per_m=size)), {})
)
kind(OUTSIDE + "cell_crosstalk", "1/N", 5e-5, nowhere, scale=(0.0, -1.0))(
    lambda robot, size, draws: (replace(robot, cell=replace(robot.cell, crosstalk_per_N=size)), {})
)


@kind(OUTSIDE + "short_waves", "rad", 8e-5, each_joint)
def short_waves(robot: PhysicalRobot, size: float, draws: Draws, joint: int) -> Applied:
    """Teeth of a motor's pinion: of orders far above what the poses of a campaign can resolve."""
    orders, phases = draws.uniform(45.0, 120.0, 3), draws.uniform(0, 6.28, 3)
    waves = zip(orders, [size / np.sqrt(3)] * 3, phases, strict=True)
    return waving(robot, joint, *waves), {}
