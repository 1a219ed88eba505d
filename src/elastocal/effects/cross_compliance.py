"""Elastic coupling of two joints: each turns under the torque of the other.

Catalogue row 17, elastic part: c_ij (J_i tau_j + J_j tau_i).
"""

from itertools import combinations

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "cross_compliance", "elastic"
WORDS = "elastic coupling"
_PARAMETERS = (Parameter("compliance", "rad/(N m)", 2e-7),)


def candidates(sites):
    """One candidate a pair of joints that turn."""

    def of(one, other):
        def displacement(conditions):
            return [{one: conditions.total[:, other], other: conditions.total[:, one]}]

        return Candidate(NAME, FAMILY, (one + 1, other + 1), "", _PARAMETERS, displacement, frozenset({"load"}))

    revolute = [joint for joint in range(sites.joints) if not sites.prismatic[joint]]
    return [of(one, other) for one, other in combinations(revolute, 2)]
