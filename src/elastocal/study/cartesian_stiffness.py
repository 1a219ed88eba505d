"""Equation 6: the Cartesian stiffness K_c of the loaded arm, w = K_c dt.

Under load the arm turns, and the torques of a given wrench with it. With K_G = d(J^T w)/dq the springs yield by
theta = (K_theta - K_G)^-1 J^T w instead of K_theta^-1 J^T w, so that K_c = (J (K_theta - K_G)^-1 J^T)^-1: Salisbury's stiffness
[1] with the term that makes it conservative [2].

[1] Salisbury, J. K., Active stiffness control of a manipulator in Cartesian coordinates, IEEE Conference on Decision and
    Control, 1980.
[2] Chen, S.-F. and Kao, I., Conservative congruence transformation for joint and Cartesian stiffness matrices of robotic hands
    and fingers, International Journal of Robotics Research 19, 2000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.elastostatics import joint_torques

if TYPE_CHECKING:
    from elastocal.mechanics.chain import MeasuringPoint
    from elastocal.mechanics.robot import Robot

# Turns of a loaded arm are milliradians, so that each pass leaves a thousandth of the error of the one before.
_PASSES = 6


def torque_gradient(jacobian: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """K_G: derivatives of the torques J^T w by the joint angles, in closed form for a serial chain.

    `jacobian` (..., 6, n): of the point where the wrench acts. `wrench` (..., 6): fixed in base axes. Returns (..., n, n): row
    for the torque, column for the angle; N m.
    """
    linear, angular = jacobian[..., :3, :], jacobian[..., 3:, :]
    row, column = np.indices(2 * jacobian.shape[-1:])
    moved = np.cross(angular[..., np.minimum(row, column)], linear[..., np.maximum(row, column)], axis=-3)
    # A joint turns the axes of those behind it, not of those before.
    turned = np.where(column < row, np.cross(angular[..., column], angular[..., row], axis=-3), 0.0)
    return np.einsum("...kij,...k->...ij", np.concatenate([moved, turned], axis=-3), wrench)


def loaded_compliance(jacobian: np.ndarray, compliance: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Inverse of K_c: deflection per wrench, (..., 6, 6).

    `jacobian` (..., 6, n). `compliance` (n,): rad/(N m). `gradient` (..., n, n): from `torque_gradient`; zero for an arm that
    does not turn under load.
    """
    springs = np.linalg.inv(np.diag(1.0 / compliance) - gradient)
    return jacobian @ springs @ np.swapaxes(jacobian, -1, -2)


def equilibrium(robot: Robot, joint_angles: np.ndarray, wrench: np.ndarray, at: MeasuringPoint) -> np.ndarray:
    """How far the joints yield where torques are those of the loaded arm: theta = C J(q + theta)^T w by fixed-point iteration.

    `joint_angles` (..., n): unloaded, rad. `wrench` (..., 6) at the point `at`. Returns (..., n): rad.
    """
    theta = np.zeros_like(joint_angles)
    for _ in range(_PASSES):
        theta = robot.compliance * joint_torques(robot.chain, joint_angles + theta, wrench, at)
    return theta
