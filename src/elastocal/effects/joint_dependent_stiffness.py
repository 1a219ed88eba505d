"""A joint compliance that changes with the angle of the joint: teeth, rollers and housing are not equally stiff all round.

theta_i = tau_i (u cos q_i + v sin q_i), with theta_i and the joint angle q_i in rad, tau_i the torque of load and declared
masses (N m), u and v in rad/(N m). Derived here: c_i(q_i) is periodic, and u and v are order 1 of its Fourier series, beside
the mean, which is the compliance of the model.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import LOADED_JOINTS, Candidate, per_joint
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "joint_dependent_stiffness", "elastic"
MOVES_ROBOT = True
WORDS = "angle-dependent stiffness"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint."""

    def at(joint: int) -> Candidate:
        parameters = sized(NAME, "variation", ["cos_q", "sin_q"], "rad/(N m)", sites, joint)

        def displacement(conditions: Conditions) -> Displacements:
            angle, torque = conditions.joint_angles[:, joint], conditions.total[:, joint]
            return [{joint: torque * np.cos(angle)}, {joint: torque * np.sin(angle)}]

        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, LOADED_JOINTS)

    return per_joint(sites, at)
