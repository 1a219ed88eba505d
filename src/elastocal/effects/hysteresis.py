"""Friction and backlash that hold a joint back on the side from which it came: the gear stays wound up when the motor stops.

theta_i = h_i s_i, with s_i = -1 or +1 the sense in which the joint was approached, 0 where it is not known, and h_i half the
width of the loop (rad; m for a prismatic joint), negative where the joint stays short: friction F sgn(dq/dt) [1] that is left
at rest winds up a gear of compliance c by c F. Where the approach is not recorded this is part of the repeatability.

[1] B. Armstrong-Hélouvry, Control of Machines with Friction, Kluwer, 1991.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate, needed, per_joint
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "hysteresis", "gearbox"
MOVES_ROBOT = True
WORDS = "hysteresis"


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint."""

    def at(joint: int) -> Candidate:
        def displacement(conditions: Conditions) -> Displacements:
            return [{joint: needed(conditions.approach)[:, joint]}]

        unit, quantity = ("m", "shift") if sites.prismatic[joint] else ("rad", "turn")
        parameters = sized(NAME, quantity, ["half_width"], unit, sites)
        return Candidate(NAME, FAMILY, (joint + 1,), "", parameters, displacement, frozenset({"approach"}))

    return per_joint(sites, at, prismatic=True)
