"""Torque of a spring or gas gravity compensator on the shoulder: it bears part of the weight of the arm, more in some poses.

T = -dU/dq = K a L (1 - s0/s) sin(alpha + q), U = K (s - s0)^2 / 2, s^2 = a^2 + L^2 + 2 a L cos(alpha + q),

in N m, for a spring of stiffness K (N/m) and free length s0 (m) between a crank a on the joint and an anchor at the distance L
(m) [1]. For a short crank, a << L, it is a sine of q and of 2q with unknown phases, under the law of a gas cylinder too; the
compliance of the joint turns it into theta = sum_k u_k cos(k q) + v_k sin(k q), k = 1, 2, in rad.

[1] A. Klimchik, Y. Wu, C. Dumas, S. Caro, B. Furet and A. Pashkevich, Identification of geometrical and elastostatic parameters
    of heavy industrial robots, IEEE International Conference on Robotics and Automation, 2013.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements, Parameter
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "compensator_torque", "gravity"
MOVES_ROBOT = True
WORDS = "torque of the gravity compensator"


def candidates(sites: Sites) -> list[Candidate]:
    """Two candidates where the robot file has a compensator: with the crank's part, and as for a crank that is very short."""
    joint = turned_joint(sites)
    if joint is None:
        return []

    parameters = wave_parameters(NAME, "turn", "rad", sites, joint)

    def displacement(conditions: Conditions) -> Displacements:
        return [{joint: wave} for wave in waves(conditions.joint_angles[:, joint])]

    def first_order(conditions: Conditions) -> Displacements:
        return displacement(conditions)[:2]

    return [
        Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement),
        Candidate(NAME, FAMILY, (joint + 1,), "first order", parameters[:2], first_order),
    ]


def turned_joint(sites: Sites) -> int | None:
    """Joint on which the compensator acts, from 0; None where the robot file has none."""
    if sites.compensator is None or sites.prismatic[sites.compensator.joint - 1]:
        return None
    return sites.compensator.joint - 1


def waves(angle: np.ndarray) -> list[np.ndarray]:
    """Cosine and sine of an angle (S,) and of twice the angle, in the order of the parameters; list of ndarray (S,)."""
    return [wave(order * angle) for order in (1, 2) for wave in (np.cos, np.sin)]


def wave_parameters(effect: str, quantity: str, unit: str, sites: Sites, joint: int) -> tuple[Parameter, ...]:
    """Parameters of `waves`, of which those of twice the angle are half as large."""
    each = (sized(effect, quantity, [f"cos_{order}q", f"sin_{order}q"], unit, sites, joint, over=order) for order in (1, 2))
    return tuple(parameter for order in each for parameter in order)
