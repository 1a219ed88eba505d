"""Stiffness that a gravity compensator adds to the shoulder, K(q) = K_0 + K a L [...], linearised: c (1 + u cos q + v sin q).

Catalogue row 11. With pose data alone it is the same as a shoulder whose own stiffness depends on its angle.
"""

from dataclasses import replace

from elastocal.effects import joint_dependent_stiffness

NAME, FAMILY = "compensator_stiffness", "elastic"
WORDS = "stiffness of the gravity compensator"


def candidates(sites):
    """One candidate, where the robot file has a compensator."""
    joint = sites.compensator.joint if sites.compensator else None
    found = [candidate for candidate in joint_dependent_stiffness.candidates(sites) if candidate.joints == (joint,)]
    return [replace(candidate, effect=NAME, family=FAMILY) for candidate in found]
