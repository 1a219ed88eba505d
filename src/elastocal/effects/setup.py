"""Set-up: tracker, nests and foot that move during a campaign."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from elastocal.effects.protocol import Shape, effect, moved_and_turned, needed
from elastocal.effects.sizes import Size

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "drift")
_HOUR_S = 3600.0
# The nearest of these has all but a 24th of the measurements on the right side of the step. Nearer to an end than the outermost
# a step would be a shift of nearly all measurements.
_WHEN = Shape("when", "1", 0.5, 1 / 12, 11 / 12, tried=11)


# Tracker and foot drift alike in the measurements, and a task counts from where the foot stands.
@_effect(
    "drift of the tracker or of the robot's foot",
    Size("shift an hour", 2e-4, "a tripod on a warming floor"),
    Size("turn an hour", 1e-4, "the same over its height"),
    moves_robot=False,
)
def frame_drift(own: Effect, sites: Sites) -> Candidates:
    """A tracker or a robot's foot that drifts: stand, floor or bolts settle, and all measurements move as one rigid body.

    u = t (d, r) at the foot in base axes, with t the time since the first measurement (h), d in m/h and r in rad/h; a point p
    (m) moves by t (d + r x p). Derived here: to first order in time a slow rigid motion is its velocity times t.
    """
    six = moved_and_turned(own.size("shift an hour", sites), own.size("turn an hour", sites), "/h")

    def law(around: Conditions) -> Displacements:
        hours = needed(around.time_s) / _HOUR_S
        return [{coordinate: hours} for coordinate in sites.base]

    yield own.candidate((), six, law, {"time"}, of_setup=True)


# As a drift.
@_effect(
    "shift of the set-up between rows",
    Size("shift", 5e-4, "a stand that is knocked"),
    Size("turn", 2e-4, "the same over its height"),
    moves_robot=False,
    parameter_words={"when": "share of the measurements before it"},
)
def setup_step(own: Effect, sites: Sites) -> Candidates:
    """A tracker, a nest or a foot that was moved between two rows: a rigid motion of all measurements from there on.

    u = (d, r) at the foot in base axes from the share w of the campaign on, zero before; d in m, r in rad, and a point p (m)
    moves by d + r x p. Where it happens is a shape: w = 0 is the first row of the campaign, 1 its last. A step needs no clock:
    the rows stand in the order in which they were read, and where the rows are not known the poses count by their numbers.
    Derived here: a small rigid motion times a unit step.
    """
    six = moved_and_turned(own.size("shift", sites), own.size("turn", sites))

    def law(around: Conditions, when: float) -> Displacements:
        after = (needed(around.progress) >= when).astype(float)
        return [{coordinate: after} for coordinate in sites.base]

    yield own.candidate((), six, law, shapes=(_WHEN,), of_setup=True)
