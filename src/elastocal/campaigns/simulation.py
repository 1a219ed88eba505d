"""Campaigns of a simulated robot: ladders of loads at random poses, read with noise, as
a calibrator would measure them."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.elastostatics import (
    extended_chain,
    generalized_forces,
    spring_compliance,
    wrench_of_offset_force,
)
from elastocal.mechanics.kinematics import poses_and_jacobians, poses_of_points
from elastocal.mechanics.robot import Robot
from elastocal.random_streams import open_stream


@dataclass(frozen=True)
class Plan:
    """What is measured.

    `points`: measuring points with a target each. `force_N`: largest force of the
    ladder; the direction is random in each pose. `ladder`: shares of it, 0 first: each
    is a load. `offset_m`: from the end-effector to where the force acts, base axes.
    `repeats`, `repeated_poses`: how often the loads 0 and 1 of the first poses are
    approached. `noise_m`, `noise_rad`: standard deviation of each component of a
    measurement.
    """

    points: tuple[str, ...]
    poses: int
    force_N: float
    ladder: tuple[float, ...]
    offset_m: tuple[float, ...]
    repeats: int
    repeated_poses: int
    noise_m: float
    noise_rad: float


def draw_measurements(
    robot: Robot, plan: Plan, seed: int, name: str
) -> dict[str, np.ndarray]:
    """Measurements of a robot with elastic joints and, where it has them, elastic
    links.

    Springs yield by the virtual joint method, see `mechanics.elastostatics`; poses are
    exact.

    `name`: of the campaign; part of the name of the random stream. Returns columns of a
    file of measurements.
    """
    draws = open_stream(seed, name, "campaign", 0)
    low, high = robot.joint_limits.T
    angles = low + (high - low) * draws.random((plan.poses, robot.joints))
    direction = draws.standard_normal((plan.poses, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    visits = [
        (pose, load, repeat)
        for pose in range(plan.poses)
        for load in range(len(plan.ladder))
        for repeat in range(
            plan.repeats if pose < plan.repeated_poses and load < 2 else 1
        )
    ]
    pose, load, repeat = np.array(visits).T
    force = plan.force_N * np.array(plan.ladder)[load, None] * direction[pose]
    wrench = wrench_of_offset_force(force, plan.offset_m)
    chain = extended_chain(robot)
    coordinates = chain.at(angles[pose])
    jacobian = poses_and_jacobians(
        chain, coordinates, replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0))
    )[2]
    deflected = coordinates + generalized_forces(jacobian, wrench) @ spring_compliance(
        robot
    )
    position, rotation = poses_of_points(
        chain, deflected, [chain.point(point) for point in plan.points]
    )
    noise = draws.standard_normal((len(plan.points), 2, len(pose), 3))
    shift, turn = np.moveaxis(noise, 1, 0).reshape(2, -1, 3)
    turned = Rotation.from_rotvec(plan.noise_rad * turn) * Rotation.from_matrix(
        rotation.reshape(-1, 3, 3)
    )
    read = np.column_stack(
        [position.reshape(-1, 3) + plan.noise_m * shift, turned.as_rotvec()]
    )
    columns = {"pose": pose, "load": load, "repeat": repeat} | dict(
        zip(WRENCH_NAMES, wrench.T, strict=True)
    )
    columns |= {f"q{joint}": column for joint, column in enumerate(angles[pose].T, 1)}
    table = {
        name: np.tile(column, len(plan.points)) for name, column in columns.items()
    }
    table |= dict(zip(("x", "y", "z", "rx", "ry", "rz"), read.T, strict=True))
    return table | {"target": np.repeat(plan.points, len(pose))}
