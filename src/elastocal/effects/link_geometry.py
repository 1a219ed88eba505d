"""Wrong dimensions of a link: machining and assembly leave its far end shifted and turned from where the drawing has it.

u = (d, r), the same at every pose, in the frame of the chain at the far end, d in m and r in rad: to first order all that
Denavit-Hartenberg or Hayati parameters [1] can be wrong by, without their singularities. Components that other links, the
base or the tool make as well are not identifiable and are held by the fit.

[1] W. Khalil and E. Dombre, Modeling, Identification and Control of Robots, Hermes Penton, 2002.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, moved_and_turned, per_joint
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "link_geometry", "geometry"
MOVES_ROBOT = True
WORDS = "geometric error"
PART = "link"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a link behind a joint, named by that joint; the column before joint 1 belongs to the base."""

    parameters = moved_and_turned(size_of(NAME, "length", sites), size_of(NAME, "turn", sites))

    def at(joint: int) -> Candidate:
        def displacement(conditions: Conditions) -> Displacements:
            ones = np.ones(len(conditions.joint_angles))
            return [{coordinate: ones} for coordinate in sites.link_end[joint + 1]]

        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, fixed=True)

    return per_joint(sites, at, prismatic=True)
