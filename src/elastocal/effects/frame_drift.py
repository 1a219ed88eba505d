"""A tracker or a robot's foot that drifts: stand, floor or bolts settle, and all measurements move as one rigid body.

u = t (d, r) at the foot in base axes, with t the time since the first measurement (h), d in m/h and r in rad/h; a point p (m)
moves by t (d + r x p). Derived here: to first order in time a slow rigid motion is its velocity times t.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate, moved_and_turned, needed
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "frame_drift", "drift"
# Tracker and foot drift alike in the measurements, and a task counts from where the foot stands.
MOVES_ROBOT = False
WORDS = "drift of the tracker or of the robot's foot"
_HOUR_S = 3600.0


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate, at the foot."""
    parameters = moved_and_turned(size_of(NAME, "shift an hour", sites), size_of(NAME, "turn an hour", sites), "/h")

    def displacement(conditions: Conditions) -> Displacements:
        hours = needed(conditions.time_s) / _HOUR_S
        return [{coordinate: hours} for coordinate in sites.base]

    return [Candidate(NAME, FAMILY, (), "", parameters, displacement, frozenset({"time"}), of_setup=True)]
