"""Zero offset of a joint: delta on its coordinate at every pose, with and without load.

Catalogue row 1. An offset of the first joint is a turn of the base, one of the last a turn of the tool.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, per_joint

NAME, FAMILY = "joint_offset", "geometry"
WORDS = "zero offset"
_TURN, _SHIFT = Parameter("offset", "rad", 1e-3), Parameter("offset", "m", 1e-3)


def candidates(sites):
    """One candidate a joint."""

    def at(joint):
        def displacement(conditions):
            return [{joint: np.ones(len(conditions.joint_angles))}]

        parameter = _SHIFT if sites.prismatic[joint] else _TURN
        return Candidate(NAME, FAMILY, (joint + 1,), "", (parameter,), displacement)

    return per_joint(sites, at, prismatic=True)
