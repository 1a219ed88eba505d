"""A tracker, a nest or a foot that was moved between two rows: a rigid motion of all measurements from there on.

u = (d, r) at the foot in base axes from the share w of the campaign on, zero before; d in m, r in rad, and a point p (m) moves
by d + r x p. Where it happens is a shape: w = 0 is the first row of the campaign, 1 its last. A step needs no clock: the rows
stand in the order in which they were read, and where the rows are not known the poses count by their numbers. Derived here:
a small rigid motion times a unit step.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate, Shape, moved_and_turned, needed
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "setup_step", "drift"
# Tracker and foot step alike in the measurements, and a task counts from where the foot stands.
MOVES_ROBOT = False
WORDS = "shift of the set-up between rows"
PARAMETER_WORDS = {"when": "share of the measurements before it"}
# The nearest of these has all but a 24th of the measurements on the right side of the step. Nearer to an end than the outermost
# a step would be a shift of nearly all measurements.
_WHEN = Shape("when", "1", 0.5, 1 / 12, 11 / 12, tried=11)


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate, at the foot."""
    parameters = moved_and_turned(size_of(NAME, "shift", sites), size_of(NAME, "turn", sites))

    def displacement(conditions: Conditions, when: float) -> Displacements:
        after = (needed(conditions.progress) >= when).astype(float)
        return [{coordinate: after} for coordinate in sites.base]

    return [Candidate(NAME, FAMILY, (), "", parameters, displacement, shapes=(_WHEN,), of_setup=True)]
