"""Zero offset of a joint: its encoder was mastered a little off the mark.

theta_i = delta_i at every pose, with and without load, in rad (m for a prismatic joint) [1]_. An offset of the first joint is a
turn of the base, one of the last a turn of the tool: they are identifiable only where frame and target are known.

References
----------
.. [1] W. Khalil and E. Dombre, Modeling, Identification and Control of Robots, Hermes Penton, 2002.
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
