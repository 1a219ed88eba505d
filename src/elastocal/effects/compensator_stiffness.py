"""Stiffness that a gravity compensator adds to the shoulder: its spring resists a small turn more in some poses than in others.

k = -dT/dq = K a L [(s0/s) (cos p + a L sin^2 p / s^2) - cos p], p = alpha + q,

is what the spring [1] adds (N m/rad), with T and its symbols as in `compensator_torque`, and -c^2 k is what that adds to the
compliance c of the joint. For a short crank it is theta = tau (u_1 cos q + v_1 sin q + u_2 cos 2q + v_2 sin 2q), with theta in
rad, tau the torque of load and declared masses (N m), u and v in rad/(N m). With order 1 alone it is the same as a shoulder
whose own stiffness depends on its angle.

[1] A. Klimchik, Y. Wu, C. Dumas, S. Caro, B. Furet and A. Pashkevich, Identification of geometrical and elastostatic parameters
    of heavy industrial robots, IEEE International Conference on Robotics and Automation, 2013.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects import compensator_torque
from elastocal.effects.protocol import LOADED_JOINTS, Candidate

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "compensator_stiffness", "elastic"
MOVES_ROBOT = True
WORDS = "stiffness of the gravity compensator"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate, where the robot file has a compensator."""
    joint = compensator_torque.turned_joint(sites)
    if joint is None:
        return []

    parameters = compensator_torque.wave_parameters(NAME, "variation", "rad/(N m)", sites, joint)

    def displacement(conditions: Conditions) -> Displacements:
        torque = conditions.total[:, joint]
        return [{joint: torque * wave} for wave in compensator_torque.waves(conditions.joint_angles[:, joint])]

    return [Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, LOADED_JOINTS)]
