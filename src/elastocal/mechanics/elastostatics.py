"""Equations 6-10: what a wrench does to a chain of springs.

Wrenches are (force, moment) in N and N m at the end-effector, base axes. Deflections are (displacement, rotation vector) in m
and rad, base axes. Compliances of rotary springs are in rad/(N m).

The virtual joint method: elastic joints, and six-dimensional springs at the ends of links, are joints that yield to the
generalized forces of the wrench [1], [2]. Forces are taken at the unloaded pose.

[1] Salisbury, J. K., Active stiffness control of a manipulator in Cartesian coordinates, IEEE Conference on Decision and
    Control, 1980.
[2] Pashkevich, A., Chablat, D. and Wenger, P., Stiffness analysis of overconstrained parallel manipulators, Mechanism and
    Machine Theory 44, 2009.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.kinematics import jacobians, poses
from elastocal.mechanics.pose_differences import pose_differences

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain, MeasuringPoint


def wrench_of_offset_force(
    force: np.ndarray, offset_m: Sequence[float] | np.ndarray, rotation: np.ndarray | None = None
) -> np.ndarray:
    """Wrench at the end-effector of a force whose line of action is shifted from it.

    `force` (..., 3): N, base axes. `offset_m` (3,): from the end-effector to the point of application, m. `rotation` (..., 3,
    3): orientation of the end-effector where the offset turns with the tool; without it the offset is along base axes. Returns
    (..., 6).
    """
    lever = np.asarray(offset_m, float)
    if rotation is not None:
        lever = rotation @ lever
    return np.concatenate([force, np.cross(lever, force)], axis=-1)


def generalized_forces(jacobian: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Torques (forces) on the coordinates of a chain, J^T w (the right-hand factor of equation 7).

    The principle of virtual work, by which statics is dual to kinematics [1].

    `jacobian` (..., 6, n): of the point where the wrench is stated. `wrench` (..., 6). Returns (..., n).

    [1] Siciliano, B., Sciavicco, L., Villani, L. and Oriolo, G., Robotics: Modelling, Planning and Control, Springer, 2009.
    """
    return np.asarray(sum(jacobian[..., row, :] * wrench[..., row, None] for row in range(6)))


def loaded_point(chain: Chain, point: MeasuringPoint, wrench_at: str) -> MeasuringPoint:
    """Where the wrench acts that deflects a measuring point (interpretation R6).

    `wrench_at`: one of "end_effector", "measuring_point". Returns the end-effector itself, whatever target sits on it; or the
    measuring point.
    """
    return replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)) if wrench_at == "end_effector" else point


def joint_torques(chain: Chain, joint_angles: np.ndarray, wrench: np.ndarray, at: MeasuringPoint) -> np.ndarray:
    """Torques that a wrench puts on the joints.

    `joint_angles` (..., n): rad. `wrench` (..., 6). `at`: where the wrench is stated, see `loaded_point`. Returns (..., n): N
    m.
    """
    return generalized_forces(jacobians(chain, joint_angles, at), wrench)


def regressor(jacobian: np.ndarray, torques: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """Matrix A of equation 10, with columns J_j J_j^T w, so that the deflection is A c (equation 9).

    `jacobian` (..., 6, n): of the measuring point. `torques` (..., n): N m; J^T w of the loaded point. `out` (..., 6, n):
    overwritten with the result; may be the Jacobian itself. Returns (..., 6, n): m or rad per rad/(N m).
    """
    return np.multiply(jacobian, torques[..., None, :], out=out)


def exact_deflections(
    chain: Chain, coordinates: np.ndarray, spring_deflections: np.ndarray, point: MeasuringPoint
) -> np.ndarray:
    """Deflection of a measuring point by the exact kinematics: the pose at q + theta against the pose at q.

    `chain`: may be an extended chain; then `coordinates` and `spring_deflections` cover its link springs too. `coordinates`,
    `spring_deflections` (..., n): q (zero for link springs) and theta of equation 7, rad or m. Returns (..., 6).
    """
    unloaded = poses(chain, coordinates, point)
    loaded = poses(chain, coordinates + spring_deflections, point)
    return pose_differences(*loaded, *unloaded)
