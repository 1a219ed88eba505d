"""Zero offset of a joint: its encoder was mastered a little off the mark.

theta_i = delta_i at every pose, with and without load, in rad (m for a prismatic joint) [1]. An offset of the first joint is a
turn of the base, one of the last a turn of the tool: they are identifiable only where frame and target are known.

[1] W. Khalil and E. Dombre, Modeling, Identification and Control of Robots, Hermes Penton, 2002.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, per_joint
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "joint_offset", "geometry"
MOVES_ROBOT = True
WORDS = "zero offset"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint."""

    def at(joint: int) -> Candidate:
        def displacement(conditions: Conditions) -> Displacements:
            return [{joint: np.ones(len(conditions.joint_angles))}]

        unit, quantity = ("m", "shift") if sites.prismatic[joint] else ("rad", "turn")
        parameters = sized(NAME, quantity, ["offset"], unit, sites)
        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, fixed=True)

    return per_joint(sites, at, prismatic=True)
