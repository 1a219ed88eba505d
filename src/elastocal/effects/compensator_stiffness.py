"""Stiffness that a gravity compensator adds to the shoulder: c (u_1 cos q + v_1 sin q + u_2 cos 2q + v_2 sin 2q) per torque.

Catalogue row 11: K(q) = K_0 + K a L [cos u - (s0/s) (cos u - a L sin^2 u / s^2)], the second derivative of the spring's energy,
whose first is the torque of `compensator_torque`: where the crank is short, orders 1 and 2 with unknown phases. With order 1
alone it is the same as a shoulder whose own stiffness depends on its angle.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "compensator_stiffness", "elastic"
WORDS = "stiffness of the gravity compensator"
_PARAMETERS = tuple(Parameter(f"{wave}_{order}q", "rad/(N m)", 2e-7 / order) for order in (1, 2) for wave in ("cos", "sin"))


def candidates(sites):
    """One candidate, where the robot file has a compensator."""
    if sites.compensator is None or sites.prismatic[sites.compensator.joint - 1]:
        return []
    joint = sites.compensator.joint - 1

    def displacement(circumstances):
        angle, torque = circumstances.joint_angles[:, joint], circumstances.total[:, joint]
        return [{joint: torque * wave(order * angle)} for order in (1, 2) for wave in (np.cos, np.sin)]

    return [Candidate(NAME, FAMILY, (joint + 1,), "", _PARAMETERS, displacement, frozenset({"load"}))]
