"""A flange, its bearing or a tool changer that yields elastically: what holds the tool is a spring behind the last joint.

u = C w, with u the shift (m) and turn (rad) of the flange along its axes, w the external force (N) and moment (N m) there
and C diagonal, m/N and rad/(N m): a spring in six directions, as in complete stiffness models of serial robots [1]. The turn
about the axis of the last joint is that of its compliance, and is held by the fit where that is identified.

[1] A. Klimchik, S. Caro, B. Furet and A. Pashkevich, Complete stiffness model for a serial robot, International Conference on
    Informatics in Control, Automation and Robotics, 2014.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import LOADED_JOINTS, Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "flange_flexibility", "elastic"
MOVES_ROBOT = True
WORDS = "flexibility of the flange"


def candidates(sites: Sites) -> list[Candidate]:
    """Two candidates at the last measuring point: all six directions, and turns alone, which is most of what a flange does."""
    coordinates = sites.link_end[-1]
    shifts = sized(NAME, "shift", [f"shift_{axis}" for axis in "xyz"], "m/N", sites)
    turns = sized(NAME, "turn", [f"turn_{axis}" for axis in "xyz"], "rad/(N m)", sites, sites.joints - 1)

    def displacement(conditions: Conditions) -> Displacements:
        return [{coordinate: conditions.load[:, coordinate]} for coordinate in coordinates]

    def turning(conditions: Conditions) -> Displacements:
        return displacement(conditions)[3:]

    load = LOADED_JOINTS
    return [
        Candidate(NAME, FAMILY, (), "", (*shifts, *turns), displacement, load),
        Candidate(NAME, FAMILY, (), "turns", turns, turning, load),
    ]
