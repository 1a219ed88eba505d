"""Elastic coupling of two joints: each turns under the torque of the other, as where one flexible casting holds both gears.

theta_i = c_ij tau_j and theta_j = c_ij tau_i, with theta in rad, tau the torques of load and declared masses (N m) and c_ij in
rad/(N m), the same both ways by the reciprocal theorem of elastic bodies [1]. Beside the compliances of two parallel joints,
seen at the end-effector alone, it is not distinguishable from bending of the link between them in its plane.

[1] S. P. Timoshenko and J. N. Goodier, Theory of Elasticity, 3rd edition, McGraw-Hill, 1970.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

from elastocal.effects.protocol import LOADED_JOINTS, Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "cross_compliance", "elastic"
MOVES_ROBOT = True
WORDS = "elastic coupling"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a pair of joints that turn."""

    def of(one: int, other: int) -> Candidate:
        parameters = sized(NAME, "coupling", ["compliance"], "rad/(N m)", sites, one, other)

        def displacement(conditions: Conditions) -> Displacements:
            return [{one: conditions.total[:, other], other: conditions.total[:, one]}]

        return Candidate(NAME, FAMILY, (one + 1, other + 1), "", parameters, displacement, LOADED_JOINTS)

    revolute = [joint for joint in range(sites.joints) if not sites.prismatic[joint]]
    return [of(one, other) for one, other in combinations(revolute, 2)]
