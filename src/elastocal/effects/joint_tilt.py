"""A bearing that tilts across its axis under the moment that it carries.

theta_e = c_e (e . M_i) at joint i, with theta_e the tilt (rad) about each of the two axes e across the joint's own, which turn
with it, M_i the moment of load and declared masses there (N m) and c_e in rad/(N m) [1]. The carriage of a prismatic joint
rolls about its own axis as well.

[1] C. Reinl, M. Friedmann, J. Bauer, M. Pischan, E. Abele and O. von Stryk, Model-based off-line compensation of path deviation
    for industrial robots in milling applications, IEEE/ASME Conference on Advanced Intelligent Mechatronics, 2011.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate, load_behind, per_joint
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "joint_tilt", "elastic"
MOVES_ROBOT = True
WORDS = "bearing tilt"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint, with one compliance for each axis across its own."""

    def at(joint: int) -> Candidate:
        # A carriage rolls about its own axis too, which is no joint's.
        across = [axis for axis in range(3) if sites.prismatic[joint] or axis != sites.joint_axes[joint]]
        parameters = sized(NAME, "tilt", [f"tilt_about_{'xyz'[axis]}" for axis in across], "rad/(N m)", sites, joint)
        coordinates = [sites.tilt[joint][axis] for axis in across]

        def displacement(conditions: Conditions) -> Displacements:
            return [{c: conditions.total[:, c]} for c in coordinates]

        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, load_behind(sites, joint))

    return per_joint(sites, at, prismatic=True)
