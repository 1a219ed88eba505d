"""Geometric errors: constant ones, drifts of tracker and robot base, and thermal
growth."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import (
    WAVES,
    Parameter,
    Shape,
    declare_with_prior,
    effect,
    every_joint,
    moved_and_turned,
    waves,
)
from elastocal.effects.sizes import REACH, Size

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidate, Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "geometry")
_drift = partial(effect, "drift")
_NEST_ORDER = 2
_SAMPLES_PER_PERIOD = 4
_HOUR_S = 3600.0
# Shares of the campaign before the step. With eleven values, at most a 24th of the
# measurements is on the wrong side of the step. A step closer to either end could not be
# distinguished from a shift of all measurements.
_WHEN = Shape("when", "1", 0.5, 1 / 12, 11 / 12, tried=11)
# Temperature at which dimensions are stated (ISO 1).
_REFERENCE_C = 20.0
# Shorter links are offsets between axes, whose growth and bending are negligible.
_SHORTEST_M = 0.05
_GRADIENT_WORDS = {
    "along ": "along the arm",
    "": "across it",
    "column ": "across the column",
}
# Shapes of a thermal law, by its cause. The castings of a robot follow their motors and
# the air within a quarter of an hour to some hours. In the order of the rows these are
# shares of a campaign of two hours.
CAUSES = {
    "temperature": (),
    "time": (Shape("lag", "s", 3600.0, 900.0, 36000.0),),
    "order": (Shape("lag", "1", 0.5, 0.125, 5.0),),
}
# What the causes are called.
_CAUSE_WORDS = {
    "temperature": "by temperature",
    "time": "by time",
    "order": "by the order of the rows",
}


@_effect(
    "zero offset",
    Size("turn", 1e-3, "mastered by marks; up to 10 mrad on measured robots"),
    Size("shift", 4e-4, "as the lengths of links", REACH),
    at=every_joint,
    formula=r"\theta_i = \delta_i",
)
def joint_offset(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Zero offset of a joint, whose encoder was mastered slightly beside its mark.

    theta_i = delta_i at every pose, with and without load, in rad (m for a prismatic
    joint) (Khalil and Dombre 2002). The offset of the first joint rotates the base and
    that of the last joint the tool, so that they are identifiable only if frame and
    target are known.
    """
    quantity, unit = ("shift", "m") if sites.prismatic[joint] else ("turn", "rad")
    offset = entry.parameters(quantity, ["offset"], unit, sites)
    yield entry.of_joint(
        joint, offset, lambda conditions: [conditions.ones], fixed=True
    )


@_effect(
    "geometric error",
    Size("length", 4e-4, "tolerance of castings: a millimetre in 2.5 m", REACH),
    Size("turn", 1e-3, "a millimetre per metre"),
    at=every_joint,
    part="link",
    formula=r"u = \begin{pmatrix} d \\ r \end{pmatrix}",
)
def link_geometry(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Wrong dimensions of a link: machining and assembly shift and rotate its far end
    against the drawing.

    u = (d, r), the same at every pose, in the frame of the chain at the far end, d in m
    and r in rad. To first order this covers all errors of Denavit-Hartenberg or Hayati
    parameters (Khalil and Dombre 2002), without their singularities. Components that
    other links, the base or the tool can produce too are not identifiable; the fit keeps
    them at zero.
    """
    six = moved_and_turned(entry.size("length", sites), entry.size("turn", sites))
    end = sites.link_end[joint + 1]
    yield entry.candidate(
        (joint + 1,),
        six,
        lambda conditions: [{c: conditions.ones} for c in end],
        fixed=True,
    )


# This effect moves the robot, because its tasks refer to the declared base frame.
@_effect(
    "base displaced from its declared placement",
    Size(
        "shift",
        5e-4,
        "a tracker is registered to 0.05 to 0.3 mm, unless a step goes wrong",
    ),
    Size("turn", 3e-4, "the same over the distance between reflectors"),
    formula=r"u = \begin{pmatrix} d \\ r \end{pmatrix}",
)
def base_placement(entry: Effect, sites: Sites) -> Candidates:
    """A robot base that stands elsewhere than the campaign declares: a constant shift and
    rotation.

    u = (d, r) at the foot in base axes, d in m and r in rad; a point p (m) moves by d +
    r x p. If the placement of the base is unknown, it is fitted instead. A rotation about a
    vertical first axis is the zero offset of joint 1.
    """
    six = moved_and_turned(entry.size("shift", sites), entry.size("turn", sites))
    yield entry.candidate(
        (),
        six,
        lambda conditions: [{c: conditions.ones} for c in sites.base],
        {"declared base"},
    )


def declared_base(sites: Sites) -> Candidate:
    """Make one candidate of the robot's place on a base whose registrations are not exact.

    It is the catalogue's `base_placement` with its size as the prior, so that the mean of
    the registrations and the robot's place share what all sessions have in common. Tasks
    refer to the declared base, so that the robot's place moves it in them.
    """
    (candidate,) = base_placement.candidates(sites)
    sizes = [parameter.plausible for parameter in candidate.parameters]
    return declare_with_prior(candidate, "declared_base", sizes)


# The reflector circles in its nest; the flange does not.
@_effect(
    "eccentric reflector nest",
    Size("shift", 5e-5, "a worn reflector nest"),
    moves_robot=False,
    formula=r"d = \sum_e e\, (a_e \cos 2 q + b_e \sin 2 q)",
)
def nest_eccentricity(entry: Effect, sites: Sites) -> Candidates:
    """A reflector whose centre is beside the axis of its nest at the flange, so that it
    circles as the last joint turns.

    d = sum_e e (a_e cos 2q + b_e sin 2q) over the two axes e across the last joint, in
    the frame that turns with it; d, a_e and b_e in m, q the angle of that joint in rad.
    Derived here: in the Fourier series of d, order 0 is a shift of the target. Order 1,
    if it circles against the joint, is a geometric error of a link. Order 2 is the lowest
    order that neither of them can produce; it arises if ball or nest are oval and the
    reflector turns to face the tracker (Muralikrishnan et al. 2016).
    """
    last = sites.joints - 1
    if sites.prismatic[last]:
        return
    across = [axis for axis in range(3) if axis != sites.joint_axes[last]]
    size = entry.size("shift", sites)
    parameters = [
        Parameter(f"{wave}_{'xyz'[axis]}_{_NEST_ORDER}q", "m", size, size)
        for axis in across
        for wave in WAVES
    ]

    def law(conditions: Conditions) -> Displacements:
        to_link = sites.link_rotations[last + 1].T
        cosine_and_sine = waves(conditions.joint_angles[:, last], _NEST_ORDER)
        shifts = [
            np.outer(to_link[:, axis], wave)
            for axis in across
            for wave in cosine_and_sine
        ]
        end = sites.link_end[last + 1][:3]
        return [dict(zip(end, shift, strict=True)) for shift in shifts]

    yield entry.candidate(
        (),
        parameters,
        law,
        distinct_angles=_SAMPLES_PER_PERIOD * _NEST_ORDER,
        turning=(last + 1,),
    )


# The tracker measures wrong lengths; the robot itself is unchanged.
@_effect(
    "scale error of the tracker",
    Size("scale", 2e-5, "air that is 20 K or 70 hPa off the entered values"),
    moves_robot=False,
    formula=r"p' = (1 + s)\, p",
)
def tracker_scale(entry: Effect, sites: Sites) -> Candidates:
    """A tracker that measures all lengths too long or too short, because of its wavelength
    in warm air or a wrong absolute distance.

    p' = (1 + s) p about the tracker, with p a position (m) and s the scale error (m/m)
    (Muralikrishnan et al. 2016). Scaling about the base instead differs by a shift of the
    frame, which is fitted if it is unknown. If all positions are scaled about the base,
    then column, links and travels along a track are longer by that share.
    """

    def law(conditions: Conditions) -> Displacements:
        travels = {
            joint: conditions.joint_angles[:, joint]
            for joint, slides in enumerate(sites.prismatic)
            if slides
        }
        return [scale_displacements(conditions.ones, lengthened) | travels]

    lengthened = lengthen(sites, np.ones(sites.joints + 1))
    yield entry.candidate((), entry.parameters("scale", ["scale"], "m/m", sites), law)


def lengthen(sites: Sites, shares: np.ndarray) -> dict[int, float]:
    """Displace the far ends of the column and of all links, which are longer by these
    shares (n + 1,); displacements by coordinate, m."""
    displacements: dict[int, float] = {}
    vectors = sites.link_vectors_m * shares[:, None]
    for end, vector in zip(sites.link_end, vectors.tolist(), strict=True):
        displacements |= zip(end[:3], vector, strict=True)
    return displacements


def scale_displacements(
    amount: np.ndarray, displacements: dict[int, float]
) -> dict[int, np.ndarray]:
    """Multiply the displacement of each coordinate by an amount in each state (S,)."""
    return {
        coordinate: amount * displacement
        for coordinate, displacement in displacements.items()
        if displacement
    }


# Tracker and base drift alike in the measurements. Tasks refer to the base as it stands,
# so that they do not feel the drift.
@_drift(
    "drift of the tracker or the robot base",
    Size("shift an hour", 2e-4, "a tripod on a warming floor"),
    Size("turn an hour", 1e-4, "the same over the height of the stand"),
    Size("shift", 4e-4, "the same, in a campaign of two hours"),
    Size("turn", 2e-4, "the same over the height of the stand"),
    at=lambda sites: [("time", " an hour", "/h"), ("order", "", "")],
    moves_robot=False,
    detail_words=_CAUSE_WORDS,
    formula=(
        r"u = t \begin{pmatrix} d \\ r \end{pmatrix} \text{, or } u = w "
        r"\begin{pmatrix} d \\ r \end{pmatrix} \text{ after the share } w "
        r"\text{ of the campaign}"
    ),
)
def frame_drift(
    entry: Effect, sites: Sites, clock: str, per: str, unit: str
) -> Candidates:
    """A tracker or a robot base that drifts: stand, floor or bolts settle, and all
    measurements move as one rigid body.

    u = t (d, r) at the foot in base axes, with t the time since the first measurement
    (h), d in m/h and r in rad/h; a point p (m) moves by t (d + r x p). If the times are
    unknown, the share w of the campaign before the row takes the place of t, d is in m
    and r in rad: the rows are then assumed to follow each other at an even pace.
    """
    six = moved_and_turned(
        entry.size(f"shift{per}", sites), entry.size(f"turn{per}", sites), unit
    )

    def law(conditions: Conditions) -> Displacements:
        elapsed = conditions.progress
        if clock == "time":
            elapsed = conditions.time_s / _HOUR_S
        return [{coordinate: elapsed} for coordinate in sites.base]

    detail = "" if clock == "time" else clock
    yield entry.candidate((), six, law, {clock}, detail=detail, of_setup=True)


# Tasks refer to the base as it stands, as for a drift.
@_drift(
    "shift of the set-up between rows",
    Size("shift", 5e-4, "a stand that was knocked"),
    Size("turn", 2e-4, "the same over the height of the stand"),
    moves_robot=False,
    parameter_words={"when": "share of the measurements before it"},
    formula=(
        r"u = \begin{pmatrix} d \\ r \end{pmatrix} \text{ from the share } w "
        r"\text{ of the campaign on, } 0 \text{ before}"
    ),
)
def setup_step(entry: Effect, sites: Sites) -> Candidates:
    """A tracker, a nest or a robot base that was moved between two rows: all later
    measurements move as one rigid body.

    u = (d, r) at the foot in base axes from the share w of the campaign on, zero
    before; d in m, r in rad, and a point p (m) moves by d + r x p. The share w is a
    shape: w = 0 is the first row of the campaign, 1 its last. A step needs no times. If
    the rows are unknown, the numbers of the poses take their place.
    """
    six = moved_and_turned(entry.size("shift", sites), entry.size("turn", sites))

    def law(conditions: Conditions, when: float) -> Displacements:
        return [
            {coordinate: (conditions.progress >= when).astype(float)}
            for coordinate in sites.base
        ]

    yield entry.candidate((), six, law, shapes=(_WHEN,), of_setup=True)


def compute_warming(conditions: Conditions, cause: str, *lag: float) -> np.ndarray:
    """Compute how much the robot has warmed, ndarray (S,): K above the temperature at which
    dimensions are stated, or a share of the final rise.

    Parameters
    ----------
    conditions : of S states.
    cause : key of `CAUSES`.
    lag : time constant in s, or as a share of the campaign; none for the temperature.
    """
    if cause == "temperature":
        return conditions.temperature_c - _REFERENCE_C
    elapsed = conditions.time_s if cause == "time" else conditions.progress
    return -np.expm1(-elapsed / lag[0])


@_drift(
    "thermal growth of the links",
    Size("expansion", 3e-5, "aluminium, and slightly more for the gears", sign=1),
    Size("final growth", 3e-4, "the expansion by 10 K"),
    at=lambda sites: [
        ("temperature", "expansion", "1/K"),
        ("time", "final growth", "m/m"),
        ("order", "final growth", "m/m"),
    ],
    detail_words=_CAUSE_WORDS,
    formula=(
        r"\delta l = \alpha\, \Delta T\, l \quad \text{or} \quad \delta l = g "
        r"\left( 1 - e^{-t / t_0} \right) l"
    ),
)
def thermal_growth(
    entry: Effect, sites: Sites, cause: str, quantity: str, unit: str
) -> Candidates:
    """Column and links that grow: motors, gears and the air warm the castings, which
    expand.

    dl = alpha dT l for each length l (m). If the temperature is measured, alpha is the
    expansion (1/K) and dT the temperature above 20 °C, at which dimensions are stated
    (ISO 1). If only the time t (s) is known, dl = g (1 - exp(-t / t_0)) l, with g the
    final growth (m/m) and t_0 (s) the time constant of a body of uniform temperature
    (Incropera and DeWitt 2002). If the times are unknown too, both are shares of the
    campaign, as if its rows followed each other at an even pace.
    """
    growth = entry.parameters(quantity, [quantity.replace(" ", "_")], unit, sites)
    lengthened = lengthen(sites, np.ones(sites.joints + 1))

    def law(conditions: Conditions, *lag: float) -> Displacements:
        return [
            scale_displacements(compute_warming(conditions, cause, *lag), lengthened)
        ]

    yield entry.candidate((), growth, law, {cause}, shapes=CAUSES[cause], detail=cause)


def _gradient_places(sites: Sites) -> list[tuple[int | None, str]]:
    """List each long link, by the number of the joint before it and 0 for the column, and
    None for the whole arm; each with each cause."""
    lengths = np.linalg.norm(sites.link_vectors_m, axis=1)
    long_links = np.flatnonzero(lengths > _SHORTEST_M).tolist()
    return [(link, cause) for link in (*long_links, None) for cause in CAUSES]


@_drift(
    "temperature gradient",
    Size(
        "curvature a kelvin", 2e-5, "steel, half of the temperature rise across 0.3 m"
    ),
    Size("curvature", 1.5e-4, "the curvature by 8 K"),
    at=_gradient_places,
    part="link",
    detail_words={"along": "along the arm"}
    | {
        f"{prefix}{cause}": f"{description}, {cause_words}"
        for prefix, description in _GRADIENT_WORDS.items()
        for cause, cause_words in _CAUSE_WORDS.items()
    },
    formula=(
        r"\delta y = \tfrac{1}{2} \alpha g\, \Delta T\, l^2, \quad \delta r = "
        r"\alpha g\, \Delta T\, l, \quad \delta l = b (x - x_0)\, \Delta T\, l"
    ),
)
def temperature_gradient(
    entry: Effect, sites: Sites, link: int | None, cause: str
) -> Candidates:
    """An arm that is warmer on one side or at one end, because motors, sun or a draught
    warm it unevenly.

    A gradient g (K/m) across a link bends it to the curvature alpha g (1/m) (Boley and
    Weiner 1960), with alpha the expansion (1/K). The far end of a link of length l (m) is
    shifted to the side by l^2 / 2 times that (m) and rotated by l times that (rad). Along
    the arm, motors and gears at the base are warmer than the wrist: a link whose middle
    is x (m) from the base grows by the share b (x - x_0), with x_0 the mean over the arm,
    whose length stays the same. Both are proportional to the temperature above 20 °C if
    it is measured (parameters in 1/(K m)), and otherwise to a first-order lag since the
    start of the campaign (1/m), by its times or else by the order of its rows.
    """
    quantity, unit = {
        "temperature": ("curvature a kelvin", "1/(K m)"),
        "time": ("curvature", "1/m"),
        "order": ("curvature", "1/m"),
    }[cause]
    displacements = _gradient_displacements(sites, link)

    def law(conditions: Conditions, *lag: float) -> Displacements:
        warming = compute_warming(conditions, cause, *lag)
        return [
            scale_displacements(warming, displacement)
            for displacement in displacements.values()
        ]

    size = entry.size(quantity, sites)
    parameters = [Parameter(name, unit, size) for name in displacements]
    location = {None: "along", 0: "column"}.get(link, "")
    detail = f"{location} {cause}".strip()
    joints = (link,) if link else ()
    yield entry.candidate(
        joints,
        parameters,
        law,
        {cause},
        shapes=CAUSES[cause],
        detail=detail,
        location_name=location,
    )


def _gradient_displacements(
    sites: Sites, link: int | None
) -> dict[str, dict[int, float]]:
    """Displacements of the far ends of links per unit of each parameter of a temperature
    gradient, by coordinate."""
    if link is None:
        lengths = np.linalg.norm(sites.link_vectors_m, axis=1)
        middle = np.cumsum(lengths) - lengths / 2
        shares = middle - middle @ lengths / lengths.sum()
        return {"growth_along": lengthen(sites, shares)}
    displacements = {}
    vector = sites.link_vectors_m[link]
    length = np.linalg.norm(vector)
    for axis in sites.transverse_axes(link):
        # Project the axis onto the plane across the link. A constant curvature about it
        # rotates the far end by the length, and shifts it as a rotation about the middle
        # of the link does.
        across = np.eye(3)[axis] - vector[axis] * vector / length**2
        shift = np.cross(across, vector) * length / 2
        end = np.concatenate([shift, length * across])
        displacements[f"curvature_about_{'xyz'[axis]}"] = dict(
            zip(sites.link_end[link], end.tolist(), strict=True)
        )
    return displacements
