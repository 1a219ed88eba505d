"""Equations 5-10: what a wrench does to a chain of springs; the extended model, whose
links are springs too.

Wrenches are (force, moment) in N and N m at the end-effector, base axes. Deflections
are (displacement, rotation vector) in m and rad, base axes. By the virtual joint method
elastic joints, and six-dimensional springs at the ends of links, are joints that yield
to the generalized forces of the wrench [1], [2], in rad/(N m). Forces are taken at the
unloaded pose.

[1] Salisbury, J. K., Active stiffness control of a manipulator in Cartesian coordinates, IEEE Conference on Decision and
    Control, 1980.
[2] Pashkevich, A., Chablat, D. and Wenger, P., Stiffness analysis of overconstrained parallel manipulators, Mechanism and
    Machine Theory 44, 2009.
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
    """Wrench at the end-effector of a force whose line of action is shifted from it.

    `force` (..., 3): N, base axes. `offset_m` (3,): from the end-effector to the point
    of application, m. `rotation` (..., 3, 3): orientation of the end-effector where the
    offset turns with the tool; without it the offset is along base axes. Returns (...,
    6).
    """
    lever = np.asarray(offset_m, float)
    if rotation is not None:
        lever = rotation @ lever
    return np.concatenate([force, np.cross(lever, force)], axis=-1)


def compute_generalized_forces(jacobian: np.ndarray, wrench: np.ndarray) -> np.ndarray:
    """Torques (forces) on the coordinates of a chain, J^T w by virtual work (the
    right-hand factor of equation 7).

    `jacobian` (..., 6, n): of the point where the wrench is stated. `wrench` (..., 6).
    Returns (..., n).
    """
    return np.asarray(
        sum(jacobian[..., row, :] * wrench[..., row, None] for row in range(6))
    )


def select_loaded_point(
    chain: Chain, point: MeasuringPoint, wrench_at: str
) -> MeasuringPoint:
    """Where the wrench acts that deflects a measuring point (interpretation R6).

    `wrench_at`: "end_effector", itself, whatever target sits on it; or
    "measuring_point".
    """
    return (
        replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0))
        if wrench_at == "end_effector"
        else point
    )


def compute_joint_torques(
    chain: Chain, joint_angles: np.ndarray, wrench: np.ndarray, at: MeasuringPoint
) -> np.ndarray:
    """Torques on the joints, ndarray (..., n), N m, by a wrench (..., 6) stated at a
    point, see `loaded_point`."""
    return compute_generalized_forces(
        compute_jacobians(chain, joint_angles, at), wrench
    )


def build_regressor(
    jacobian: np.ndarray, torques: np.ndarray, out: np.ndarray | None = None
) -> np.ndarray:
    """Matrix A of equation 10, with columns J_j J_j^T w, so that the deflection is A c
    (equation 9), ndarray (..., 6, n).

    `jacobian` (..., 6, n): of the measuring point. `torques` (..., n): J^T w of the
    loaded point. `out`: overwritten with the result; may be the Jacobian itself.
    """
    return np.multiply(jacobian, torques[..., None, :], out=out)


def compute_exact_deflections(
    chain: Chain,
    coordinates: np.ndarray,
    spring_deflections: np.ndarray,
    point: MeasuringPoint,
) -> np.ndarray:
    """Deflection of a measuring point by the exact kinematics: the pose at q + theta
    against the pose at q.

    `chain`: may be an extended chain; then `coordinates` and `spring_deflections` cover
    its link springs too. `coordinates`, `spring_deflections` (..., n): q (zero for link
    springs) and theta of equation 7, rad or m. Returns (..., 6).
    """
    unloaded = compute_poses(chain, coordinates, point)
    loaded = compute_poses(chain, coordinates + spring_deflections, point)
    return compute_pose_differences(*loaded, *unloaded)


def compute_tube_compliance(tube: Tube, length_m: float) -> np.ndarray:
    """Compliance of a cantilever tube at its tip, beam along x (Euler-Bernoulli bending
    [1], St Venant torsion [2]).

    Returns (6, 6): deflection (m, rad) per wrench (N, N m), both at the tip, in the
    frame of the beam.

    [1] Przemieniecki, J. S., Theory of Matrix Structural Analysis, McGraw-Hill, 1968.
    [2] Timoshenko, S. P. and Goodier, J. N., Theory of Elasticity, McGraw-Hill, 1970.
    """
    outer = tube.outer_diameter_m
    inner = tube.outer_diameter_m - 2 * tube.wall_m
    length = length_m
    area = np.pi * (outer**2 - inner**2) / 4
    bending = tube.youngs_modulus_Pa * np.pi * (outer**4 - inner**4) / 64
    torsion = tube.shear_modulus_Pa * np.pi * (outer**4 - inner**4) / 32
    sideways = [length**3 / (3 * bending)] * 2
    along = length / (tube.youngs_modulus_Pa * area)
    compliance = np.diag(
        [along, *sideways, length / torsion, length / bending, length / bending]
    )
    compliance[1, 5] = compliance[5, 1] = length**2 / (2 * bending)
    compliance[2, 4] = compliance[4, 2] = -(length**2) / (2 * bending)
    return compliance


def compute_beam_axes(link: Link) -> np.ndarray:
    """Axes of a link as a beam, x along it, twice: of displacements and of rotations;
    (6, 6), columns in the chain's frame."""
    along = np.array(link.vector_m) / np.linalg.norm(link.vector_m)
    # A round tube has no preferred lateral axes: any right-handed triad with x along
    # the link will do.
    helper = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, helper) / np.linalg.norm(np.cross(along, helper))
    return np.kron(np.eye(2), np.column_stack([along, across, np.cross(along, across)]))


def build_extended_chain(robot: Robot) -> Chain:
    """The robot's chain with Tx Ty Tz Rx Ry Rz springs (equation 5) at the far end of
    each link, behind those of the joints."""
    return insert_coordinates(
        robot.chain,
        dict.fromkeys((link.after for link in robot.links), SIX_DISPLACEMENTS),
    )


def build_spring_compliance(robot: Robot) -> np.ndarray:
    """Compliance of all springs of the extended chain, joints, then links: the inverse
    of K_theta in equation 7, (m, m)."""
    n = robot.joints
    compliance = np.zeros((n + 6 * len(robot.links),) * 2)
    compliance[:n, :n] = np.diag(robot.compliance)
    for number, link in enumerate(robot.links):
        block = slice(n + 6 * number, n + 6 * number + 6)
        turn = compute_beam_axes(link)
        compliance[block, block] = (
            turn
            @ compute_tube_compliance(link.tube, float(np.linalg.norm(link.vector_m)))
            @ turn.T
        )
    return compliance
