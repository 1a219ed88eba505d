"""Data sets as the paper makes them: random configurations and forces, exact deflections, noise.

Arrays have the axes (data set, configuration, ...).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import exact_deflections, generalized_forces, loaded_point, wrench_of_offset_force
from elastocal.mechanics.kinematics import jacobians, poses
from elastocal.mechanics.links import extended_chain, spring_compliance
from elastocal.random_streams import draw
from elastocal.study.experiments import Experiments

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain, MeasuringPoint
    from elastocal.mechanics.robot import Robot


@dataclass(frozen=True)
class Loading:
    """How the robot is moved and loaded.

    `force_N`: magnitude. `direction`: of the force, base axes; without one it is uniform on the sphere. `offset_m`: from the
    end-effector to where the force acts. `offset_frame`: axes of the offset (interpretation R4). `joint_range`: joint angles
    uniform in +-pi or within the robot's limits (interpretation R3).
    """

    force_N: float
    offset_m: tuple[float, ...]
    offset_frame: str
    joint_range: str
    direction: tuple[float, ...] | None = None


def random_experiments(
    chain: Chain,
    limits: np.ndarray,
    seed: int,
    key: str,
    loading: Loading,
    purpose: str,
    data_sets: Sequence[int] | np.ndarray,
    configurations: int,
) -> Experiments:
    """Random configurations and wrenches.

    Forces have the directions of normal vectors, which are uniform on the sphere [1].

    `limits` (n, 2): joint limits in rad. `key`: name of the robot's file; part of the name of the random streams. `purpose`:
    part of the name of the random streams: data that identify and data that judge never share one. `configurations`: in each
    data set; the first k of them do not depend on how many there are.

    [1] Muller, M. E., A note on a method for generating points uniformly on n-dimensional spheres, Communications of the ACM 2,
        1959.
    """
    n = chain.coordinates
    turns = draw(seed, key, f"{purpose}/joint angles", data_sets, lambda stream: stream.random((configurations, n)))
    low, high = limits.T if loading.joint_range == "limits" else (np.full(n, -np.pi), np.full(n, np.pi))
    joint_angles = low + (high - low) * turns
    if loading.direction is None:
        normal = draw(seed, key, f"{purpose}/force", data_sets, lambda stream: stream.standard_normal((configurations, 3)))
    else:
        normal = np.broadcast_to(np.array(loading.direction, float), (*joint_angles.shape[:-1], 3))
    force = loading.force_N * normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    rotation = poses(chain, joint_angles, chain.end_effector)[1] if loading.offset_frame == "tool" else None
    return Experiments(joint_angles, wrench_of_offset_force(force, loading.offset_m, rotation))


def true_deflections(robot: Robot, experiments: Experiments, point: MeasuringPoint, wrench_at: str) -> np.ndarray:
    """Deflection of a measuring point: theta from equation 7, then the exact kinematics of all springs.

    The virtual joint method, see `mechanics.elastostatics`.

    `robot`: reduced or, where it has links, extended. `point`: of the robot's chain. `wrench_at`: where the wrench that
    deflects a partial point is taken to act (interpretation R6). Returns (sets, configurations, 6): m, rad.
    """
    chain = extended_chain(robot)
    unloaded = chain.at(experiments.joint_angles)
    measured = replace(chain.point(point.name), offset_m=point.offset_m)
    jacobian = jacobians(chain, unloaded, loaded_point(chain, measured, wrench_at))
    springs = generalized_forces(jacobian, experiments.wrench) @ spring_compliance(robot)
    return exact_deflections(chain, unloaded, springs, measured)


def measurement_noise(
    seed: int, key: str, point_name: str, data_sets: Sequence[int] | np.ndarray, configurations: int
) -> np.ndarray:
    """Standard normal noise of the six components at one measuring point; times the noise level it is the measurement error.

    The same numbers serve every noise level, so that levels differ by scale alone: common random numbers [1].

    `seed`, `key`: as in `random_experiments`. Returns (sets, configurations, 6).

    [1] Glasserman, P. and Yao, D. D., Some guidelines and guarantees for common random numbers, Management Science 38, 1992.
    """
    return draw(seed, key, f"noise/{point_name}", data_sets, lambda stream: stream.standard_normal((configurations, 6)))
