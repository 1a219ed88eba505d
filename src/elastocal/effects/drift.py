"""Drift: tracker, nests and foot that move during a campaign, and a robot that gets warmer, by temperature or time."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.geometry import longer
from elastocal.effects.protocol import Parameter, Shape, effect, moved_and_turned, needed
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
    (m) moves by t (d + r x p).
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
    moves by d + r x p. Where it happens is a shape: w = 0 is the first row of the campaign, 1 its last. A step needs no clock;
    where the rows are not known the poses count by their numbers.
    """
    six = moved_and_turned(own.size("shift", sites), own.size("turn", sites))

    def law(around: Conditions, when: float) -> Displacements:
        after = (needed(around.progress) >= when).astype(float)
        return [{coordinate: after} for coordinate in sites.base]

    yield own.candidate((), six, law, shapes=(_WHEN,), of_setup=True)


_REFERENCE_C, _SHORTEST_M = 20.0, 0.05
# By which of them the shapes of a law go. Castings of a robot follow their motors and the air in a quarter of an hour to some
# hours.
CAUSES = {"temperature": (), "time": (Shape("lag", "s", 3600.0, 900.0, 36000.0),)}


def warmer(around: Conditions, *lag: float) -> np.ndarray:
    """By how much the robot is warmer, ndarray (S,): by the time where a lag (s) is given, by the temperature without."""
    if lag:
        return -np.expm1(-needed(around.time_s) / lag[0])
    return needed(around.temperature_c) - _REFERENCE_C


@_effect(
    "thermal growth of the links",
    Size("expansion", 3e-5, "aluminium, and a little more for the gears", sign=1),
    Size("final growth", 3e-4, "10 K of it"),
    at=lambda sites: [("temperature", "expansion", "1/K"), ("time", "final growth", "m/m")],
)
def thermal_growth(own: Effect, sites: Sites, cause: str, quantity: str, unit: str) -> Candidates:
    """Column and links that grow as they warm up: motors, gears and the air warm the castings, which expand.

    dl = alpha dT l for each length l (m). With a measured temperature alpha is the expansion (1/K) and dT the temperature above
    20 °C, at which dimensions are stated (ISO 1); with the time t (s) alone dl = g (1 - exp(-t / t_0)) l, with g the final
    growth (m/m) and t_0 (s) the lag of a body that has one temperature throughout (Incropera and DeWitt 2002).
    """
    growth = own.parameters(quantity, [quantity.replace(" ", "_")], unit, sites)
    yield own.candidate(
        (), growth, lambda around, *lag: [longer(sites, warmer(around, *lag))], {cause}, shapes=CAUSES[cause], detail=cause
    )


def _warmed(sites: Sites) -> list[tuple[int | None, str]]:
    """Each link with a length, named by the joint before it, 0 the column, and None along the arm; by each cause."""
    long = [k for k in range(sites.joints + 1) if np.linalg.norm(sites.link_vectors_m[k]) > _SHORTEST_M]
    return [(link, cause) for link in (*long, None) for cause in CAUSES]


@_effect(
    "temperature gradient",
    Size("curvature a kelvin", 2e-5, "steel, half of the warmth across 0.3 m"),
    Size("curvature", 1.5e-4, "8 K of it"),
    at=_warmed,
    part="link",
    detail_words={
        "along": "along the arm",
        **{f"along {cause}": f"along the arm, by {cause}" for cause in CAUSES},
        **{cause: f"across it, by {cause}" for cause in CAUSES},
        **{f"column {cause}": f"across the column, by {cause}" for cause in CAUSES},
    },
)
def temperature_gradient(own: Effect, sites: Sites, link: int | None, cause: str) -> Candidates:
    """An arm that is warmer on one side or at one end than at the other: motors, sun or a draught warm it unevenly.

    A gradient g (K/m) across a link bends it to the curvature alpha g (1/m) (Boley and Weiner 1960), with alpha the expansion
    (1/K), so that a link of length l (m) ends by l^2 / 2 times that to the side (m) and turned by l times that (rad). Along the
    arm motors and gears at its foot are warmer than the wrist: a link whose middle is x (m) from the foot grows by the share b
    (x - x_0), x_0 the mean over the arm, which keeps its length. Both in proportion to the temperature above 20 °C where it is
    measured, parameters in 1/(K m), or to a first-order lag since the campaign began, in 1/m.
    """
    quantity, unit = {"temperature": ("curvature a kelvin", "1/(K m)"), "time": ("curvature", "1/m")}[cause]
    if link is None:
        names, lengths = ["growth_along"], np.linalg.norm(sites.link_vectors_m, axis=1)
        middle = np.cumsum(lengths) - lengths / 2
        further = zip(sites.link_end, sites.link_vectors_m, middle - middle @ lengths / lengths.sum(), strict=True)
        # Of each coordinate of a far end the share of its link, and how far the middle of that is from the mean.
        displaced = [
            {c: (along, far) for end, vector, far in further for c, along in zip(end[:3], vector, strict=True) if along}
        ]
    else:
        names, vector = [f"curvature_about_{'xyz'[axis]}" for axis in sites.transverse_axes(link)], sites.link_vectors_m[link]
        length = np.linalg.norm(vector)
        # About the two axes least along the link, made square to it. A turn about e by s / l carries the end of a beam along x
        # by e cross x over half its length.
        about = [np.eye(3)[axis] - vector[axis] * vector / length**2 for axis in sites.transverse_axes(link)]
        ends = [np.concatenate([np.cross(e, vector) * length / 2, length * e]) for e in about]
        displaced = [{c: (part, 1.0) for c, part in zip(sites.link_end[link], end, strict=True) if part} for end in ends]

    def law(around: Conditions, *lag: float) -> Displacements:
        rise = warmer(around, *lag)
        return [{c: rise * part * times for c, (part, times) in each.items()} for each in displaced]

    parameters = [Parameter(name, unit, own.size(quantity, sites)) for name in names]
    where = {None: "along", 0: "column"}.get(link, "")
    detail, joints = f"{where} {cause}".strip(), (link,) if link else ()
    yield own.candidate(joints, parameters, law, {cause}, shapes=CAUSES[cause], detail=detail, location_name=where)
