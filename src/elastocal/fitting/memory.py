"""How much of a long campaign a fit holds at once: what is beyond comes in parts and is found again in each step."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.fitting.displacement import conditions

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

# Values of sensitivities that a fit holds at once, of which there are five copies: observations beyond come in parts, which are
# linearised again in each step.
_MOST_HELD = 4_000_000
# Observations of a part: what it makes stays in the processor's cache and is not asked of the system again and again.
_MOST_AT_ONCE = 4000
# States beyond which conditions are not kept from step to step, and with a fit, but found again: they take some ten kilobytes
# each, and there is one fit after another.
_MOST_STATES, _MOST_STATES_OF_A_FIT = 20_000, 2_000


def observations_at_once(rows: int, columns: int) -> int:
    """How many observations are linearised at once; what a linearisation makes beside parameters is as 60 of them."""
    return max(min(_MOST_HELD // (rows * max(columns, 60)), _MOST_AT_ONCE), 1)


def held_at_once(observations: Observations, columns: int) -> bool:
    """Whether the sensitivities of all observations to so many parameters are held at once."""
    return observations.rows * len(observations) * max(columns, 60) <= _MOST_HELD


def keeps_conditions(observations: Observations) -> bool:
    """Whether the conditions of all states stay with a fit."""
    return len(observations.states) <= min(_MOST_STATES, _MOST_STATES_OF_A_FIT)


def kept_conditions(model: Model, estimate: Estimate, observations: Observations) -> Conditions | None:
    """Conditions of all states, or None where these are too many to keep them."""
    return conditions(model, estimate, observations.states) if len(observations.states) <= _MOST_STATES else None
