"""What effects of warmth have in common: by how much the robot is warmer, by the temperature or by the time.

By the temperature T (°C) it is T - 20, counted from that at which dimensions are stated [1], in K; by the time t since the
campaign began (s) it is the share 1 - exp(-t / t_0) of the final warmth, the first-order lag of a lumped capacitance [2].

[1] ISO 1, Geometrical product specifications: standard reference temperature, 2016.
[2] F. P. Incropera and D. P. DeWitt, Fundamentals of Heat and Mass Transfer, Wiley, 2002.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Shape, needed

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Concatenate

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate

    # By how much the robot is warmer, ndarray (S,), from the conditions and a value of each of the shapes.
    Rise = Callable[Concatenate[Conditions, ...], np.ndarray]

_REFERENCE_C = 20.0
# Castings of a robot follow their motors and the air in a quarter of an hour to some hours.
_LAG = Shape("lag", "s", 3600.0, 900.0, 36000.0)


def by_warmth(candidate_of: Callable[[str, Rise, frozenset[str], tuple[Shape, ...]], Candidate]) -> list[Candidate]:
    """Candidates of an effect of warmth: by the temperature where it was measured, and by the time since the campaign began.

    `candidate_of`: ``candidate_of(cause, rise, needs, shapes)`` gives a candidate; ``rise(conditions, *shapes)`` is by how much
    it is warmer, ndarray (S,): in K from 20 °C, at which dimensions are stated (ISO 1), or the share of a first order lag.
    """

    def by_temperature(conditions: Conditions) -> np.ndarray:
        return needed(conditions.temperature_c) - _REFERENCE_C

    def by_time(conditions: Conditions, lag: float) -> np.ndarray:
        return -np.expm1(-needed(conditions.time_s) / lag)

    return [
        candidate_of("temperature", by_temperature, frozenset({"temperature"}), ()),
        candidate_of("time", by_time, frozenset({"time"}), (_LAG,)),
    ]
