"""Stiffness that a gravity compensator adds to the shoulder, K(q) = K_0 + K a L [...], linearised: c (1 + u cos q + v sin q).

Catalogue row 11. With pose data alone it is the same as a shoulder whose own stiffness depends on its angle.
"""

from dataclasses import replace

from elastocal.effects import joint_dependent_stiffness

NAME, FAMILY = "compensator_stiffness", "elastic"


def candidates(sites):
    """One candidate, on the first joint that carries weight."""
    if sites.shoulder is None:
        return []
    return [replace(joint_dependent_stiffness.candidates(sites)[sites.shoulder], effect=NAME, family=FAMILY)]
