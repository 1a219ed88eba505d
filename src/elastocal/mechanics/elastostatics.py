"""Equations 5-10: deflection of a chain of springs under a wrench, and the extended
model, whose links are springs as well.

Wrenches are (force, moment) in N and N m at the end-effector, in base axes. Deflections
are (displacement, rotation vector) in m and rad, in base axes. In the virtual joint
method, elastic joints and six-dimensional springs at the ends of links are joints that
yield to the generalized forces of the wrench [1], [2], in rad/(N m). Forces are
evaluated at the unloaded pose.

References
----------
[1] Salisbury, J. K., Active stiffness control of a manipulator in Cartesian
    coordinates, IEEE Conference on Decision and Control, 1980.
[2] Pashkevich, A., Chablat, D. and Wenger, P., Stiffness analysis of overconstrained
    parallel manipulators, Mechanism and Machine Theory 44, 2009.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import SIX_DISPLACEMENTS, insert_coordinates
from elastocal.mechanics.kinematics import (
    compute_jacobians,
    compute_pose_differences,
    compute_poses,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.mechanics.chain import Chain, MeasuringPoint
    from elastocal.mechanics.robot import Link, Robot, Tube


def compute_offset_wrench(
    force: np.ndarray,
    offset_m: Sequence[float] | np.ndarray,
    rotation: np.ndarray | None = None,
) -> np.ndarray:
    """Compute the wrench at the end-effector of a force that acts beside it.

    Parameters
    ----------
    force : (..., 3) array, N, base axes
    offset_m : (3,), from the end-effector to the point of application
    rotation : (..., 3, 3) array, optional
        Orientation of the end-effector, if the offset turns with the tool. Without it
        the offset is in base axes.

    Returns
    -------
    (..., 6) array
    """
    lever = np.asarray(offset_m, float)
    if rotation is not None:
        lever = rotation @ lever
    return np.concatenate([force, np.cross(lever, force)], axis=-1)


def compute_generalized_forces(jacobian: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Compute the torques (forces) on the coordinates of a chain, J^T w by virtual work
    (the right-hand factor of equation 7).

    Parameters
    ----------
    jacobian : (..., 6, n) array, of the point to which the wrench refers
    wrench : (..., 6) array

    Returns
    -------
    (..., n) array
    """
    return np.asarray(
        sum(jacobian[..., row, :] * wrench[..., row, None] for row in range(6))
    )


def select_loaded_point(
    chain: Chain, point: MeasuringPoint, wrench_at: str
) -> MeasuringPoint:
    """Select the point at which the wrench acts that deflects a measuring point
    (interpretation R6).

    Parameters
    ----------
    chain : chain of the point
    point : measuring point whose deflection is computed
    wrench_at : "end_effector" for its origin, without any target, or "measuring_point"
    """
    if wrench_at == "end_effector":
        return replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0))
    return point


def compute_joint_torques(
    chain: Chain, joint_angles: np.ndarray, wrench: np.ndarray, at: MeasuringPoint
) -> np.ndarray:
    """Compute the torques (..., n) in N m on the joints of a wrench (..., 6) that
    refers to a point, see `select_loaded_point`."""
    return compute_generalized_forces(
        compute_jacobians(chain, joint_angles, at), wrench
    )


def build_regressor(
    jacobian: np.ndarray, torques: np.ndarray, out: np.ndarray | None = None
) -> np.ndarray:
    """Build matrix A of equation 10, with columns J_j J_j^T w, so that the deflection
    is A c (equation 9).

    Parameters
    ----------
    jacobian : (..., 6, n) array, of the measuring point
    torques : (..., n) array, J^T w of the loaded point
    out : array, optional
        Overwritten with the result; may be the Jacobian itself.

    Returns
    -------
    (..., 6, n) array
    """
    return np.multiply(jacobian, torques[..., None, :], out=out)


def compute_exact_deflections(
    chain: Chain,
    coordinates: np.ndarray,
    spring_deflections: np.ndarray,
    point: MeasuringPoint,
) -> np.ndarray:
    """Compute the deflection of a measuring point by the exact kinematics: the pose at
    q + theta against the pose at q.

    Parameters
    ----------
    chain : Chain
        For an extended chain, the coordinates include its link springs.
    coordinates : (..., n) array, q, zero for link springs, rad or m
    spring_deflections : (..., n) array, theta of equation 7, rad or m
    point : measuring point

    Returns
    -------
    (..., 6) array
    """
    unloaded = compute_poses(chain, coordinates, point)
    loaded = compute_poses(chain, coordinates + spring_deflections, point)
    return compute_pose_differences(*loaded, *unloaded)


def compute_tube_compliance(tube: Tube, length_m: float) -> np.ndarray:
    """Compute the compliance of a cantilever tube at its tip, with the beam along x
    (Euler-Bernoulli bending [1], St Venant torsion [2]).

    Parameters
    ----------
    tube : cross-section and material
    length_m : length of the beam

    Returns
    -------
    (6, 6) array
        Deflection (m, rad) per wrench (N, N m), both at the tip, in the beam's frame.

    References
    ----------
    [1] Przemieniecki, J. S., Theory of Matrix Structural Analysis, McGraw-Hill, 1968.
    [2] Timoshenko, S. P. and Goodier, J. N., Theory of Elasticity, McGraw-Hill, 1970.
    """
    outer = tube.outer_diameter_m
    inner = tube.outer_diameter_m - 2 * tube.wall_m
    area = np.pi * (outer**2 - inner**2) / 4
    bending_stiffness = tube.youngs_modulus_Pa * np.pi * (outer**4 - inner**4) / 64
    torsion_stiffness = tube.shear_modulus_Pa * np.pi * (outer**4 - inner**4) / 32
    axial = length_m / (tube.youngs_modulus_Pa * area)
    lateral = length_m**3 / (3 * bending_stiffness)
    torsion = length_m / torsion_stiffness
    bending = length_m / bending_stiffness
    compliance = np.diag([axial, lateral, lateral, torsion, bending, bending])
    coupling = length_m**2 / (2 * bending_stiffness)
    compliance[1, 5] = compliance[5, 1] = coupling
    compliance[2, 4] = compliance[4, 2] = -coupling
    return compliance


def compute_beam_axes(link: Link) -> np.ndarray:
    """Compute the axes of a link as a beam, with x along it.

    Returns a (6, 6) array, block diagonal for displacements and rotations; its columns
    are in the chain's frame.
    """
    axial = np.array(link.vector_m) / np.linalg.norm(link.vector_m)
    # A round tube has no preferred lateral axes, so any right-handed triad with x along
    # the link will do.
    helper = np.eye(3)[np.argmin(np.abs(axial))]
    lateral = np.cross(axial, helper) / np.linalg.norm(np.cross(axial, helper))
    triad = np.column_stack([axial, lateral, np.cross(axial, lateral)])
    return np.kron(np.eye(2), triad)


def build_extended_chain(robot: Robot) -> Chain:
    """Build the robot's chain with Tx Ty Tz Rx Ry Rz springs (equation 5) at the far
    end of each link; their coordinates follow those of the joints."""
    link_ends = (link.after for link in robot.links)
    return insert_coordinates(robot.chain, dict.fromkeys(link_ends, SIX_DISPLACEMENTS))


def build_spring_compliance(robot: Robot) -> np.ndarray:
    """Build the compliance matrix (m, m) of all springs of the extended chain, joints
    before links: the inverse of K_theta in equation 7."""
    n = robot.joints
    compliance = np.zeros((n + 6 * len(robot.links),) * 2)
    compliance[:n, :n] = np.diag(robot.compliance)
    for number, link in enumerate(robot.links):
        block = slice(n + 6 * number, n + 6 * number + 6)
        axes = compute_beam_axes(link)
        length_m = float(np.linalg.norm(link.vector_m))
        tube_compliance = compute_tube_compliance(link.tube, length_m)
        compliance[block, block] = axes @ tube_compliance @ axes.T
    return compliance
