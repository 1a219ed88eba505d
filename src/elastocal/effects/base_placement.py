"""A robot whose foot does not stand where the campaign declares it: a constant shift and turn.

u = (d, r) at the foot in base axes, d in m and r in rad; a point p (m) moves by d + r x p. Where the placement of the base is
unknown it is fitted, and there is nothing to misplace. A turn about a vertical first axis is the zero offset of joint 1, and
alike in every measurement. Derived here: a small rigid motion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, moved_and_turned
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "base_placement", "geometry"
# Where the robot should be is said in the declared base's frame, in which it stands elsewhere.
MOVES_ROBOT = True
WORDS = "base that stands elsewhere than declared"
# What registering a base by a tracker leaves: 0.05 to 0.3 mm and 20 to 100 urad; several times that where a step went wrong.


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate, at the foot."""
    parameters = moved_and_turned(size_of(NAME, "shift", sites), size_of(NAME, "turn", sites))

    def displacement(conditions: Conditions) -> Displacements:
        always = np.ones(len(conditions.joint_angles))
        return [{coordinate: always} for coordinate in sites.base]

    return [Candidate(NAME, FAMILY, (), "", parameters, displacement, frozenset({"declared base"}))]
