"""Stiffness that a gravity compensator adds to the shoulder: c (u_1 cos q + v_1 sin q + u_2 cos 2q + v_2 sin 2q) per torque.

Catalogue row 11: K(q) = K_0 + K a L [cos u - (s0/s) (cos u - a L sin^2 u / s^2)], the second derivative of the spring's energy,
whose first is the torque of `compensator_torque`: where the crank is short, orders 1 and 2 with unknown phases. With order 1
alone it is the same as a shoulder whose own stiffness depends on its angle.
"""

from elastocal.effects import compensator_torque
from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "compensator_stiffness", "elastic"
WORDS = "stiffness of the gravity compensator"
_PARAMETERS = tuple(Parameter(f"{wave}_{order}q", "rad/(N m)", 2e-7 / order) for order in (1, 2) for wave in ("cos", "sin"))


def candidates(sites):
    """One candidate, where the robot file has a compensator."""
    joint = compensator_torque.turned_joint(sites)
    if joint is None:
        return []

    def displacement(conditions):
        torque = conditions.total[:, joint]
        return [{joint: torque * wave} for wave in compensator_torque.waves(conditions.joint_angles[:, joint])]

    return [Candidate(NAME, FAMILY, (joint + 1,), "", _PARAMETERS, displacement, frozenset({"load"}))]
