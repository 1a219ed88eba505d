"""An arm that is warmer on one side or at one end than at the other: motors, sun or a draught warm it unevenly.

A gradient g (K/m) across a link bends it to the curvature alpha g (1/m) [1], with alpha the expansion (1/K), so that a link
of length l (m) ends by l^2 / 2 times that to the side (m) and turned by l times that (rad). Along the arm motors and gears at
its foot are warmer than the wrist: a link whose middle is x (m) from the foot grows by the share b (x - x_0), x_0 the mean
over the arm, which keeps its length. Both in proportion to the temperature above 20 °C where it is measured, parameters in
1/(K m), or to a first-order lag since the campaign began, in 1/m.

[1] B. A. Boley and J. H. Weiner, Theory of Thermal Stresses, Wiley, 1960.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.effects.sizes import size_of
from elastocal.effects.warmth import by_warmth

if TYPE_CHECKING:
    from elastocal.effects.protocol import Displacements, Shape
    from elastocal.effects.warmth import Rise
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "temperature_gradient", "drift"
MOVES_ROBOT = True
WORDS = "temperature gradient"
PART = "link"
DETAIL_WORDS = {
    "along": "along the arm",
    "along temperature": "along the arm, by temperature",
    "along time": "along the arm, by time",
    "temperature": "across it, by temperature",
    "time": "across it, by time",
    "column temperature": "across the column, by temperature",
    "column time": "across the column, by time",
}
_QUANTITIES = {"temperature": ("curvature a kelvin", "1/(K m)"), "time": ("curvature", "1/m")}
_SHORTEST_M = 0.05


def candidates(sites: Sites) -> list[Candidate]:
    """Across each link with a length, named by the joint before it, and the column; and along the arm; by each cause."""
    lengths = np.linalg.norm(sites.link_vectors_m, axis=1)
    across = [k for k in range(sites.joints + 1) if lengths[k] > _SHORTEST_M]
    bending = [candidate for link in across for candidate in _across(sites, link)]
    return [*bending, *_along(sites, lengths)]


def _across(sites: Sites, link: int) -> list[Candidate]:
    coordinates, vector = sites.link_end[link], sites.link_vectors_m[link]
    length = np.linalg.norm(vector)
    # About the two axes least along the link, made square to it.
    about = [np.eye(3)[axis] - vector[axis] * vector / length**2 for axis in sites.transverse_axes(link)]
    names = [f"curvature_about_{'xyz'[axis]}" for axis in sites.transverse_axes(link)]

    def bent(warmer: np.ndarray) -> Displacements:
        # A turn about e by s / l carries the end of a beam along x by e cross x over half its length.
        shifts = [np.cross(e, vector) * length / 2 for e in about]
        ends = [np.concatenate([shift, length * e]) for shift, e in zip(shifts, about, strict=True)]
        return [{c: warmer * part for c, part in zip(coordinates, end, strict=True) if part} for end in ends]

    def candidate_of(cause: str, rise: Rise, needs: frozenset[str], shapes: tuple[Shape, ...]) -> Candidate:
        quantity, unit = _QUANTITIES[cause]
        plausible = size_of(NAME, quantity, sites)
        parameters = tuple(Parameter(name, unit, plausible) for name in names)
        where = cause if link else f"column {cause}"
        law = lambda conditions, *values: bent(rise(conditions, *values))  # noqa: E731
        location_name = "" if link else "column"
        return Candidate(
            NAME, FAMILY, (link,) if link else (), where, parameters, law, needs, shapes, location_name=location_name
        )

    return by_warmth(candidate_of)


def _along(sites: Sites, lengths: np.ndarray) -> list[Candidate]:
    middle = np.cumsum(lengths) - lengths / 2
    further = middle - middle @ lengths / lengths.sum()

    def grown(warmer: np.ndarray) -> dict[int, np.ndarray]:
        return {
            coordinate: warmer * along * distance
            for ends, vector, distance in zip(sites.link_end, sites.link_vectors_m, further, strict=True)
            for coordinate, along in zip(ends[:3], vector, strict=True)
            if along
        }

    def candidate_of(cause: str, rise: Rise, needs: frozenset[str], shapes: tuple[Shape, ...]) -> Candidate:
        quantity, unit = _QUANTITIES[cause]
        plausible = size_of(NAME, quantity, sites)
        law = lambda conditions, *values: [grown(rise(conditions, *values))]  # noqa: E731
        growth = (Parameter("growth_along", unit, plausible),)
        return Candidate(NAME, FAMILY, (), f"along {cause}", growth, law, needs, shapes, location_name="along")

    return by_warmth(candidate_of)
