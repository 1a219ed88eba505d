"""Simulate the campaign of a robot: several loads at random poses, measured with noise
as a calibrator would measure them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.measurements import name_joint_columns
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.elastostatics import (
    build_extended_chain,
    build_spring_compliance,
    compute_generalized_forces,
    compute_offset_wrench,
)
from elastocal.mechanics.kinematics import (
    compute_point_poses,
    compute_poses_and_jacobians,
)
from elastocal.mechanics.robot import Robot
from elastocal.random_streams import open_stream


@dataclass(frozen=True)
class Plan:
    """Plan of the measurements.

    Attributes
    ----------
    points : measuring points; each has a target.
    poses : number of poses.
    force_N : largest force; its direction is random in each pose.
    ladder : shares of the largest force, 0 first; each is a load.
    offset_m : from the end effector to the point where the force acts, base axes.
    repeats, repeated_poses : how often loads 0 and 1 are approached, in the first poses.
    noise_m, noise_rad : standard deviation of each component of a measurement.
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
    """Measure a simulated robot with elastic joints and, if it has them, elastic links.

    The springs deflect by the virtual joint method, see `mechanics.elastostatics`;
    joint angles have no error.

    Parameters
    ----------
    robot : robot that is measured.
    plan : plan of the measurements.
    seed, name : seed and name of the campaign, which name the random stream.

    Returns
    -------
    Columns of a file of measurements.
    """
    draws = open_stream(seed, name, "campaign", 0)
    angles_of_pose = _draw_angles(robot, plan.poses, draws)
    direction = draws.standard_normal((plan.poses, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    pose, load, repeat = _list_approaches(plan).T
    angles = angles_of_pose[pose]
    force = plan.force_N * np.array(plan.ladder)[load, None] * direction[pose]
    wrench = compute_offset_wrench(force, plan.offset_m)
    position, rotation = _deflected_poses(robot, plan.points, angles, wrench)
    measured = _add_noise(position, rotation, draws, plan)
    approaches = {"pose": pose, "load": load, "repeat": repeat}
    approaches |= dict(zip(WRENCH_NAMES, wrench.T, strict=True))
    approaches |= name_joint_columns(robot.reported_angles(angles))
    return _tabulate(approaches, plan.points, measured)


def _tabulate(
    approaches: dict[str, np.ndarray], points: Sequence[str], measured: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the columns of a file of measurements, one block of rows for each point.

    Parameters
    ----------
    approaches : columns (A,) that all P points have in common.
    points : names of the points.
    measured : (P A, 6) array, positions (m) and rotation vectors (rad).
    """
    table = {name: np.tile(column, len(points)) for name, column in approaches.items()}
    table |= dict(zip(("x", "y", "z", "rx", "ry", "rz"), measured.T, strict=True))
    count = len(measured) // len(points)
    return table | {"target": np.repeat(points, count)}


def _draw_angles(robot: Robot, poses: int, draws: np.random.Generator) -> np.ndarray:
    """Draw joint angles (poses, n), rad, uniformly within the limits."""
    shares = draws.random((poses, robot.commands))
    return robot.spread_angles(shares, robot.joint_limits)


def _list_approaches(plan: Plan) -> np.ndarray:
    """Return the pose, load and repeat of each approach, (A, 3) int array."""
    approaches = []
    for pose in range(plan.poses):
        for load in range(len(plan.ladder)):
            is_repeated = pose < plan.repeated_poses and load < 2
            repeats = plan.repeats if is_repeated else 1
            approaches += [(pose, load, repeat) for repeat in range(repeats)]
    return np.array(approaches)


def _deflected_poses(
    robot: Robot, points: Sequence[str], angles: np.ndarray, wrench: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions (P, A, 3), m, and rotation matrices (P, A, 3, 3) of P
    measuring points at angles (A, n) under wrenches (A, 6)."""
    chain = build_extended_chain(robot)
    coordinates = chain.at(angles)
    end_effector = replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0))
    jacobian = compute_poses_and_jacobians(chain, coordinates, end_effector)[2]
    forces = compute_generalized_forces(jacobian, wrench)
    deflected = coordinates + forces @ build_spring_compliance(robot)
    return compute_point_poses(
        chain, deflected, [chain.point(point) for point in points]
    )


def _add_noise(
    position: np.ndarray, rotation: np.ndarray, draws: np.random.Generator, plan: Plan
) -> np.ndarray:
    """Draw measured positions (m) and rotation vectors (rad), one row for each point
    and approach, (P A, 6).

    Parameters
    ----------
    position, rotation : (P, A, 3) and (P, A, 3, 3) arrays, exact poses.
    draws : random stream.
    plan : plan with the standard deviations.
    """
    points, approaches = position.shape[:2]
    noise = draws.standard_normal((points, 2, approaches, 3))
    shift, turn = np.moveaxis(noise, 1, 0).reshape(2, -1, 3)
    exact_rotation = Rotation.from_matrix(rotation.reshape(-1, 3, 3))
    measured_rotation = Rotation.from_rotvec(plan.noise_rad * turn) * exact_rotation
    return np.column_stack(
        [
            position.reshape(-1, 3) + plan.noise_m * shift,
            measured_rotation.as_rotvec(),
        ]
    )
