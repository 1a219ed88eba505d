"""Column and links that grow as they warm up: motors, gears and the air warm the castings, which expand.

dl = alpha dT l for each length l (m). With a measured temperature alpha is the expansion (1/K) and dT the temperature above 20
°C, at which dimensions are stated [1]; with the time t (s) alone dl = g (1 - exp(-t / t_0)) l, with g the final growth (m/m)
and t_0 (s) the lag of a body that has one temperature throughout [2].

[1] ISO 1, Geometrical product specifications: standard reference temperature, 2016.
[2] F. P. Incropera and D. P. DeWitt, Fundamentals of Heat and Mass Transfer, Wiley, 2002.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.effects.protocol import Candidate
from elastocal.effects.sizes import sized
from elastocal.effects.warmth import by_warmth

if TYPE_CHECKING:
    import numpy as np

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements, Shape
    from elastocal.effects.warmth import Rise
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "thermal_growth", "drift"
MOVES_ROBOT = True
WORDS = "thermal growth of the links"
_QUANTITIES = {"temperature": ("expansion", "1/K"), "time": ("final growth", "m/m")}


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate by temperature and one by time."""

    def candidate_of(cause: str, rise: Rise, needs: frozenset[str], shapes: tuple[Shape, ...]) -> Candidate:
        def displacement(conditions: Conditions, *values: float) -> Displacements:
            return [longer(sites, rise(conditions, *values))]

        quantity, unit = _QUANTITIES[cause]
        parameters = sized(NAME, quantity, [quantity.replace(" ", "_")], unit, sites)
        return Candidate(NAME, FAMILY, (), cause, parameters, displacement, needs, shapes)

    return by_warmth(candidate_of)


def longer(sites: Sites, share: np.ndarray) -> dict[int, np.ndarray]:
    """Displacement by which the column and every link are longer by a share (S,), as a dict by coordinate."""
    return {
        coordinate: share * along
        for ends, vector in zip(sites.link_end, sites.link_vectors_m, strict=True)
        for coordinate, along in zip(ends[:3], vector, strict=True)
        if along
    }
