"""Equation 5: the extended model, a six-dimensional spring at the end of each link, from a thick-walled tube."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.chain import with_inserted

if TYPE_CHECKING:
    from elastocal.mechanics.chain import Chain
    from elastocal.mechanics.robot import Link, Robot, Tube

# Kind and axis of the springs at the end of a link.
_SIX = tuple((kind, axis) for kind in "TR" for axis in range(3))


def tube_compliance(tube: Tube, length_m: float) -> np.ndarray:
    """Compliance of a cantilever tube at its tip, beam along x (Euler-Bernoulli bending [1], St Venant torsion [2]).

    Returns (6, 6): deflection (m, rad) per wrench (N, N m), both at the tip, in the frame of the beam.

    [1] Przemieniecki, J. S., Theory of Matrix Structural Analysis, McGraw-Hill, 1968.
    [2] Timoshenko, S. P. and Goodier, J. N., Theory of Elasticity, McGraw-Hill, 1970.
    """
    outer, inner, length = tube.outer_diameter_m, tube.outer_diameter_m - 2 * tube.wall_m, length_m
    area = np.pi * (outer**2 - inner**2) / 4
    bending = tube.youngs_modulus_Pa * np.pi * (outer**4 - inner**4) / 64
    torsion = tube.shear_modulus_Pa * np.pi * (outer**4 - inner**4) / 32
    compliance = np.diag(
        [
            length / (tube.youngs_modulus_Pa * area),
            length**3 / (3 * bending),
            length**3 / (3 * bending),
            length / torsion,
            length / bending,
            length / bending,
        ]
    )
    compliance[1, 5] = compliance[5, 1] = length**2 / (2 * bending)
    compliance[2, 4] = compliance[4, 2] = -(length**2) / (2 * bending)
    return compliance


def link_compliance(link: Link) -> np.ndarray:
    """Compliance of a link at its far end, in the frame of the chain there.

    Returns (6, 6).
    """
    turn = beam_axes(link)
    return turn @ tube_compliance(link.tube, float(np.linalg.norm(link.vector_m))) @ turn.T


def beam_axes(link: Link) -> np.ndarray:
    """Axes of a link as a beam, x along it, twice: of displacements and of rotations.

    Returns (6, 6): columns in the frame of the chain.
    """
    along = np.array(link.vector_m) / np.linalg.norm(link.vector_m)
    # A round tube has no preferred lateral axes: any right-handed triad with x along the link will do.
    helper = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, helper) / np.linalg.norm(np.cross(along, helper))
    return np.kron(np.eye(2), np.column_stack([along, across, np.cross(along, across)]))


def extended_chain(robot: Robot) -> Chain:
    """The robot's chain with Tx Ty Tz Rx Ry Rz springs (equation 5) at the far end of each link.

    Links of the virtual joint method: each yields in a six-dimensional virtual joint [1].

    Returns coordinates 0..n-1 are the joints as before, then six for each link in turn.

    [1] Pashkevich, A., Chablat, D. and Wenger, P., Stiffness analysis of overconstrained parallel manipulators, Mechanism and
        Machine Theory 44, 2009.
    """
    return with_inserted(robot.chain, dict.fromkeys((link.after for link in robot.links), _SIX))


def spring_compliance(robot: Robot) -> np.ndarray:
    """Aggregated compliance of all springs of the extended chain, the inverse of K_theta in equation 7.

    Returns (m, m): block diagonal: joints, then links. Without links, the diagonal of the joint compliances.
    """
    n = robot.joints
    compliance = np.zeros((n + 6 * len(robot.links),) * 2)
    compliance[:n, :n] = np.diag(robot.compliance)
    for number, link in enumerate(robot.links):
        block = slice(n + 6 * number, n + 6 * number + 6)
        compliance[block, block] = link_compliance(link)
    return compliance


def with_tube(robot: Robot, tube: Tube) -> Robot:
    """The same robot with every link made of `tube`."""
    return replace(robot, links=tuple(replace(link, tube=tube) for link in robot.links))
