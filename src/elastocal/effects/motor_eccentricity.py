"""An eccentric motor, resolver or input pinion: transmission error once and twice per turn of the motor.

theta_i = sum_k a_k cos(k N q_i) + b_k sin(k N q_i), k = 1, 2, with theta_i, a_k, b_k and the joint angle q_i in rad and N the
gear ratio, which must be known well enough for the phase of its waves. Strain wave gears, too, err in the rhythm of their
input [1]. Where the robot file has no gear ratio of a joint nothing is offered there.

[1] T. D. Tuttle, Understanding and Modeling the Behavior of a Harmonic Drive Gear Transmission, technical report, MIT
    Artificial Intelligence Laboratory, 1992.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "motor_eccentricity", "transmission"
MOVES_ROBOT = True
WORDS = "motor eccentricity"
_ORDERS = (1, 2)
# Any angles make the waves of the motor distinguishable; twice as many as there are of them, and some.
_DISTINCT_ANGLES = 12


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate for each joint whose gear ratio is known."""
    ratios = sites.gear_ratio or (None,) * sites.joints
    geared = zip(ratios, sites.prismatic, strict=True)
    return [
        _candidate(sites, joint, ratio)
        for joint, (ratio, prismatic) in enumerate(geared)
        if ratio is not None and not prismatic
    ]


def _candidate(sites: Sites, joint: int, ratio: float) -> Candidate:
    size = size_of(NAME, "amplitude", sites)
    parameters = tuple(Parameter(f"{wave}_{order}_motor", "rad", size) for order in _ORDERS for wave in ("cos", "sin"))

    def displacement(conditions: Conditions) -> Displacements:
        angle = ratio * conditions.joint_angles[:, joint]
        return [{joint: wave(order * angle)} for order in _ORDERS for wave in (np.cos, np.sin)]

    return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, distinct_angles=_DISTINCT_ANGLES, fixed=True)
