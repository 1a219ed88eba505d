"""The stand of a socket, which yields to pushes of the robot in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Parameter, effect
from elastocal.effects.sizes import Size

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import PushedSession, Sites

# Number of terms of the expansion. Those beyond hold 7 % of the variance about the mean.
_ORDERS = 8
# A session with a single row has no length; its only row is its start.
_LEAST_LENGTH = 1e-9


def pushed_sessions(sites: Sites) -> list[tuple[PushedSession]]:
    """List the sessions in which the robot sits in a place, one a location."""
    return [(session,) for session in sites.pushed_sessions]


@effect(
    "drift",
    "stand displaced by pushes",
    Size("shift", 5e-4, "a stand that was knocked, from first to last row"),
    at=pushed_sessions,
    moves_robot=False,
    formula=(
        r"u = \sum_{k=1}^{8} \frac{\sqrt 2}{k \pi} \cos(k \pi s)\, d_k"
        r"\text{ at the share } s \text{ of the session}"
    ),
)
def stand_creep(entry: Effect, sites: Sites, pushed: PushedSession) -> Candidates:
    """A stand with a socket that is not fastened and slips a little with every push of the
    robot in it.

    u = sum_k sqrt(2) / (k pi) cos(k pi s) d_k at the foot in base axes, with d_k a vector
    (m) and s the share of the session before the present row, from 0 to 1. Slips are
    independent, so their sum is a random walk. This is its Karhunen-Loeve expansion about
    its mean (Loeve, Probability Theory II, 1978, section 37.5): the components of all d_k
    are independent, and each has the standard deviation of the displacement from the
    first to the last row. The mean belongs to the unknown frame of the session.
    """
    size = entry.size("shift", sites)
    orders = range(1, _ORDERS + 1)
    parameters = [
        Parameter(f"d{axis}_{order}", "m", size) for order in orders for axis in "xyz"
    ]

    def law(conditions: Conditions) -> Displacements:
        length = max(pushed.end - pushed.start, _LEAST_LENGTH)
        share = ((conditions.progress - pushed.start) / length).clip(0.0, 1.0)
        amplitude = np.sqrt(2.0) / np.pi * (conditions.session == pushed.session)
        waves = [amplitude / order * np.cos(order * np.pi * share) for order in orders]
        return [{coordinate: wave} for wave in waves for coordinate in sites.base[:3]]

    name = f"session {pushed.session}"
    yield entry.candidate(
        (), parameters, law, detail=name, location_name=name, of_setup=True
    )
