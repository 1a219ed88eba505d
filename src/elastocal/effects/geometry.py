"""Geometry that is not as declared: fixed in time, drifting with tracker, nests and
foot, or growing with warmth."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import (
    WAVES,
    Parameter,
    Shape,
    effect,
    every_joint,
    moved_and_turned,
    waves,
)
from elastocal.effects.sizes import REACH, Size

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "geometry")
_drift = partial(effect, "drift")
_NEST_ORDER = 2
_SAMPLES_PER_PERIOD = 4
_HOUR_S = 3600.0
# The nearest of these has all but a 24th of the measurements on the right side of the
# step. Nearer to an end than the outermost a step would be a shift of nearly all
# measurements.
_WHEN = Shape("when", "1", 0.5, 1 / 12, 11 / 12, tried=11)
_REFERENCE_C = 20.0
_SHORTEST_M = 0.05
# By which of them the shapes of a law go. Castings of a robot follow their motors and
# the air in a quarter of an hour to some hours.
_WARMED_WORDS = {
    "along ": "along the arm",
    "": "across it",
    "column ": "across the column",
}
CAUSES = {"temperature": (), "time": (Shape("lag", "s", 3600.0, 900.0, 36000.0),)}


@_effect(
    "zero offset",
    Size("turn", 1e-3, "mastering by marks; measured robots have up to 10 mrad"),
    Size("shift", 4e-4, "as links", REACH),
    at=every_joint,
    formula=r"\theta_i = \delta_i",
)
def joint_offset(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Zero offset of a joint: its encoder was mastered a little off the mark.

    theta_i = delta_i at every pose, with and without load, in rad (m for a prismatic
    joint) (Khalil and Dombre 2002). Of the first joint it is a turn of the base, of the
    last one of the tool: identifiable only where frame and target are known.
    """
    quantity, unit = ("shift", "m") if sites.prismatic[joint] else ("turn", "rad")
    offset = entry.parameters(quantity, ["offset"], unit, sites)
    yield entry.of_joint(joint, offset, lambda around: [around.ones], fixed=True)


@_effect(
    "geometric error",
    Size("length", 4e-4, "tolerances of castings: a millimetre of 2.5 m", REACH),
    Size("turn", 1e-3, "a millimetre a metre"),
    at=every_joint,
    part="link",
    formula=r"u = \begin{pmatrix} d \\ r \end{pmatrix}",
)
def link_geometry(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """Wrong dimensions of a link: machining and assembly leave its far end shifted and
    turned from where the drawing has it.

    u = (d, r), the same at every pose, in the frame of the chain at the far end, d in m
    and r in rad: to first order all that Denavit-Hartenberg or Hayati parameters
    (Khalil and Dombre 2002) can be wrong by, without their singularities. Components
    that other links, the base or the tool make as well are not identifiable and are
    held by the fit.
    """
    six = moved_and_turned(entry.size("length", sites), entry.size("turn", sites))
    end = sites.link_end[joint + 1]
    yield entry.candidate(
        (joint + 1,), six, lambda around: [{c: around.ones} for c in end], fixed=True
    )


# It moves the robot, whose tasks are said in the declared base's frame.
@_effect(
    "base that stands elsewhere than declared",
    Size(
        "shift", 5e-4, "a tracker registers to 0.05 to 0.3 mm, unless a step goes wrong"
    ),
    Size("turn", 3e-4, "the same over the reflectors' distance"),
    formula=r"u = \begin{pmatrix} d \\ r \end{pmatrix}",
)
def base_placement(entry: Effect, sites: Sites) -> Candidates:
    """A robot whose foot does not stand where the campaign declares it: a constant
    shift and turn.

    u = (d, r) at the foot in base axes, d in m and r in rad; a point p (m) moves by d +
    r x p. Where the placement of the base is unknown it is fitted, and there is nothing
    to misplace. A turn about a vertical first axis is the zero offset of joint 1.
    """
    six = moved_and_turned(entry.size("shift", sites), entry.size("turn", sites))
    yield entry.candidate(
        (),
        six,
        lambda around: [{c: around.ones} for c in sites.base],
        {"declared base"},
    )


# The reflector circles in its nest, and the flange does not.
@_effect(
    "eccentric nest of the reflector",
    Size("shift", 5e-5, "a worn nest of a reflector"),
    moves_robot=False,
    formula=r"d = \sum_e e\, (a_e \cos 2 q + b_e \sin 2 q)",
)
def nest_eccentricity(entry: Effect, sites: Sites) -> Candidates:
    """A reflector whose centre is off the axis of its nest at the flange: it circles as
    the last joint turns.

    d = sum_e e (a_e cos 2q + b_e sin 2q) over the two axes e across the last joint, in
    the frame that turns with it; d, a_e and b_e in m, q the angle of that joint in rad.
    Derived here: of the Fourier series of d, order 0 is a target elsewhere and order 1,
    if it circles against the joint, a link of other dimensions; order 2 is the lowest
    of which neither makes a part, as of an oval ball or nest in which the reflector
    turns to face the tracker (Muralikrishnan et al. 2016).
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

    def law(around: Conditions) -> Displacements:
        turned = sites.link_rotations[last + 1].T
        both = waves(around.joint_angles[:, last], _NEST_ORDER)
        shifts = [np.outer(turned[:, axis], wave) for axis in across for wave in both]
        return [
            dict(zip(sites.link_end[last + 1][:3], shift, strict=True))
            for shift in shifts
        ]

    yield entry.candidate(
        (),
        parameters,
        law,
        distinct_angles=_SAMPLES_PER_PERIOD * _NEST_ORDER,
        turning=(last + 1,),
    )


# The tracker shows lengths that the robot does not have.
@_effect(
    "scale error of the tracker",
    Size("scale", 2e-5, "20 K or 70 hPa of air that were not entered"),
    moves_robot=False,
    formula=r"p' = (1 + s)\, p",
)
def tracker_scale(entry: Effect, sites: Sites) -> Candidates:
    """A tracker that measures all lengths too long or too short, by its wavelength in
    warm air or by a bad absolute distance.

    p' = (1 + s) p about the tracker, with p a position (m) and s the scale error (m/m)
    (Muralikrishnan et al. 2016). Scaled about the base positions differ from that by a
    shift of the frame, which is fitted where it is unknown; and a robot whose positions
    are all scaled about its base is one whose column, links and travels along a track
    are longer by that share.
    """

    def law(around: Conditions) -> Displacements:
        travels = {
            joint: around.joint_angles[:, joint]
            for joint, slides in enumerate(sites.prismatic)
            if slides
        }
        return [times(around.ones, every) | travels]

    every = longer(sites, np.ones(sites.joints + 1))
    yield entry.candidate((), entry.parameters("scale", ["scale"], "m/m", sites), law)


def longer(sites: Sites, shares: np.ndarray) -> dict[int, float]:
    """How the far ends move, by coordinate, where the column and each link are longer
    by their shares (n + 1,)."""
    ends = zip(sites.link_end, sites.link_vectors_m * shares[:, None], strict=True)
    return {
        coordinate: along
        for end, vector in ends
        for coordinate, along in zip(end[:3], vector.tolist(), strict=True)
    }


def times(amount: np.ndarray, moved: dict[int, float]) -> dict[int, np.ndarray]:
    """A displacement of some coordinates, of which each goes with an amount (S,)."""
    return {coordinate: amount * part for coordinate, part in moved.items() if part}


# Tracker and foot drift alike in the measurements, and a task counts from where the
# foot stands.
@_drift(
    "drift of the tracker or of the robot's foot",
    Size("shift an hour", 2e-4, "a tripod on a warming floor"),
    Size("turn an hour", 1e-4, "the same over its height"),
    moves_robot=False,
    formula=r"u = t \begin{pmatrix} d \\ r \end{pmatrix}",
)
def frame_drift(entry: Effect, sites: Sites) -> Candidates:
    """A tracker or a robot's foot that drifts: stand, floor or bolts settle, and all
    measurements move as one rigid body.

    u = t (d, r) at the foot in base axes, with t the time since the first measurement
    (h), d in m/h and r in rad/h; a point p (m) moves by t (d + r x p).
    """
    six = moved_and_turned(
        entry.size("shift an hour", sites), entry.size("turn an hour", sites), "/h"
    )
    yield entry.candidate(
        (),
        six,
        lambda around: [{c: around.time_s / _HOUR_S} for c in sites.base],
        {"time"},
        of_setup=True,
    )


# As a drift.
@_drift(
    "shift of the set-up between rows",
    Size("shift", 5e-4, "a stand that is knocked"),
    Size("turn", 2e-4, "the same over its height"),
    moves_robot=False,
    parameter_words={"when": "share of the measurements before it"},
    formula=(
        r"u = \begin{pmatrix} d \\ r \end{pmatrix} \text{ from the share } w "
        r"\text{ of the campaign on, } 0 \text{ before}"
    ),
)
def setup_step(entry: Effect, sites: Sites) -> Candidates:
    """A tracker, a nest or a foot that was moved between two rows: a rigid motion of
    all measurements from there on.

    u = (d, r) at the foot in base axes from the share w of the campaign on, zero
    before; d in m, r in rad, and a point p (m) moves by d + r x p. Where it happens is
    a shape: w = 0 is the first row of the campaign, 1 its last. A step needs no clock;
    where the rows are not known the poses count by their numbers.
    """
    six = moved_and_turned(entry.size("shift", sites), entry.size("turn", sites))

    def law(around: Conditions, when: float) -> Displacements:
        return [
            {coordinate: (around.progress >= when).astype(float)}
            for coordinate in sites.base
        ]

    yield entry.candidate((), six, law, shapes=(_WHEN,), of_setup=True)


def warmer(around: Conditions, *lag: float) -> np.ndarray:
    """By how much the robot is warmer, ndarray (S,): by the time where a lag (s) is
    given, by the temperature without."""
    if lag:
        return -np.expm1(-around.time_s / lag[0])
    return around.temperature_c - _REFERENCE_C


@_drift(
    "thermal growth of the links",
    Size("expansion", 3e-5, "aluminium, and a little more for the gears", sign=1),
    Size("final growth", 3e-4, "10 K of it"),
    at=lambda sites: [
        ("temperature", "expansion", "1/K"),
        ("time", "final growth", "m/m"),
    ],
    formula=(
        r"\delta l = \alpha\, \Delta T\, l \quad \text{or} \quad \delta l = g "
        r"\left( 1 - e^{-t / t_0} \right) l"
    ),
)
def thermal_growth(
    entry: Effect, sites: Sites, cause: str, quantity: str, unit: str
) -> Candidates:
    """Column and links that grow as they warm up: motors, gears and the air warm the
    castings, which expand.

    dl = alpha dT l for each length l (m). With a measured temperature alpha is the
    expansion (1/K) and dT the temperature above 20 °C, at which dimensions are stated
    (ISO 1); with the time t (s) alone dl = g (1 - exp(-t / t_0)) l, with g the final
    growth (m/m) and t_0 (s) the lag of a body that has one temperature throughout
    (Incropera and DeWitt 2002).
    """
    growth = entry.parameters(quantity, [quantity.replace(" ", "_")], unit, sites)
    every = longer(sites, np.ones(sites.joints + 1))

    def law(around: Conditions, *lag: float) -> Displacements:
        return [times(warmer(around, *lag), every)]

    yield entry.candidate((), growth, law, {cause}, shapes=CAUSES[cause], detail=cause)


def _warmed(sites: Sites) -> list[tuple[int | None, str]]:
    """Each link with a length, named by the joint before it, 0 the column, and None
    along the arm; by each cause."""
    long = [
        k
        for k in range(sites.joints + 1)
        if np.linalg.norm(sites.link_vectors_m[k]) > _SHORTEST_M
    ]
    return [(link, cause) for link in (*long, None) for cause in CAUSES]


@_drift(
    "temperature gradient",
    Size("curvature a kelvin", 2e-5, "steel, half of the warmth across 0.3 m"),
    Size("curvature", 1.5e-4, "8 K of it"),
    at=_warmed,
    part="link",
    detail_words={"along": "along the arm"}
    | {
        f"{where}{cause}": f"{words}, by {cause}"
        for where, words in _WARMED_WORDS.items()
        for cause in CAUSES
    },
    formula=(
        r"\delta y = \tfrac{1}{2} \alpha g\, \Delta T\, l^2, \quad \delta r = "
        r"\alpha g\, \Delta T\, l, \quad \delta l = b (x - x_0)\, \Delta T\, l"
    ),
)
def temperature_gradient(
    entry: Effect, sites: Sites, link: int | None, cause: str
) -> Candidates:
    """An arm that is warmer on one side or at one end than at the other: motors, sun or
    a draught warm it unevenly.

    A gradient g (K/m) across a link bends it to the curvature alpha g (1/m) (Boley and
    Weiner 1960), with alpha the expansion (1/K), so that a link of length l (m) ends by
    l^2 / 2 times that to the side (m) and turned by l times that (rad). Along the arm
    motors and gears at its foot are warmer than the wrist: a link whose middle is x (m)
    from the foot grows by the share b (x - x_0), x_0 the mean over the arm, which keeps
    its length. Both in proportion to the temperature above 20 °C where it is measured,
    parameters in 1/(K m), or to a first-order lag since the campaign began, in 1/m.
    """
    quantity, unit = {
        "temperature": ("curvature a kelvin", "1/(K m)"),
        "time": ("curvature", "1/m"),
    }[cause]
    if link is None:
        lengths = np.linalg.norm(sites.link_vectors_m, axis=1)
        middle = np.cumsum(lengths) - lengths / 2
        moved = {
            "growth_along": longer(sites, middle - middle @ lengths / lengths.sum())
        }
    else:
        moved = {}
        vector = sites.link_vectors_m[link]
        length = np.linalg.norm(sites.link_vectors_m[link])
        for axis in sites.transverse_axes(link):
            # About an axis of those least along the link, made square to it. A turn
            # about e by s / l carries the end of a beam along x by e cross x over half
            # its length.
            about = np.eye(3)[axis] - vector[axis] * vector / length**2
            end = np.concatenate([np.cross(about, vector) * length / 2, length * about])
            moved[f"curvature_about_{'xyz'[axis]}"] = dict(
                zip(sites.link_end[link], end.tolist(), strict=True)
            )

    def law(around: Conditions, *lag: float) -> Displacements:
        rise = warmer(around, *lag)
        return [times(rise, each) for each in moved.values()]

    parameters = [Parameter(name, unit, entry.size(quantity, sites)) for name in moved]
    where = {None: "along", 0: "column"}.get(link, "")
    detail = f"{where} {cause}".strip()
    joints = (link,) if link else ()
    yield entry.candidate(
        joints,
        parameters,
        law,
        {cause},
        shapes=CAUSES[cause],
        detail=detail,
        location_name=where,
    )
