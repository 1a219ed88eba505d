"""A gear that gets stiffer with torque: J_i k3_i tau_i^3.

Catalogue row 12.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, per_joint

NAME, FAMILY = "stiffening", "gearbox"
# The end of the robot moves by so much under a pull of so much, at the least lever of a tool.
_MOVED_M, _PULL_N, _LEAST_LEVER_M = 5e-3, 1e3, 0.5


def candidates(sites):
    """One candidate a joint; small gears carry less torque and may bend more by it."""

    def at(joint):
        lever = max(np.linalg.norm(sites.link_vectors_m[joint + 1 :], axis=1).sum(), _LEAST_LEVER_M)
        cubic = Parameter("cubic", "rad/(N m)^3", _MOVED_M / lever / (_PULL_N * lever) ** 3)

        def displacement(circumstances):
            return [{joint: circumstances.load[:, joint] ** 3}]

        return Candidate(NAME, FAMILY, (joint + 1,), "", (cubic,), displacement, frozenset({"load"}))

    return per_joint(sites, at)
