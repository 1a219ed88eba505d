"""Geometry: effects that are there without a load and fixed in time."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import WAVES, Parameter, effect, every_joint, moved_and_turned, waves
from elastocal.effects.sizes import REACH, Size

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "geometry")
_NEST_ORDER, _SAMPLES_PER_PERIOD = 2, 4


@_effect(
    "zero offset",
    Size("turn", 1e-3, "mastering by marks; measured robots have up to 10 mrad"),
    Size("shift", 4e-4, "as links", REACH),
    at=every_joint,
)
def joint_offset(own: Effect, sites: Sites, joint: int) -> Candidates:
    """Zero offset of a joint: its encoder was mastered a little off the mark.

    theta_i = delta_i at every pose, with and without load, in rad (m for a prismatic joint) (Khalil and Dombre 2002). Of the
    first joint it is a turn of the base, of the last one of the tool: identifiable only where frame and target are known.
    """
    quantity, unit = ("shift", "m") if sites.prismatic[joint] else ("turn", "rad")
    offset = own.parameters(quantity, ["offset"], unit, sites)
    yield own.of_joint(joint, offset, lambda around: [around.always], fixed=True)


@_effect(
    "geometric error",
    Size("length", 4e-4, "tolerances of castings: a millimetre of 2.5 m", REACH),
    Size("turn", 1e-3, "a millimetre a metre"),
    at=every_joint,
    part="link",
)
def link_geometry(own: Effect, sites: Sites, joint: int) -> Candidates:
    """Wrong dimensions of a link: machining and assembly leave its far end shifted and turned from where the drawing has it.

    u = (d, r), the same at every pose, in the frame of the chain at the far end, d in m and r in rad: to first order all that
    Denavit-Hartenberg or Hayati parameters (Khalil and Dombre 2002) can be wrong by, without their singularities. Components
    that other links, the base or the tool make as well are not identifiable and are held by the fit.
    """
    six, end = moved_and_turned(own.size("length", sites), own.size("turn", sites)), sites.link_end[joint + 1]
    yield own.candidate((joint + 1,), six, lambda around: [{c: around.always} for c in end], fixed=True)


# It moves the robot, whose tasks are said in the declared base's frame.
@_effect(
    "base that stands elsewhere than declared",
    Size("shift", 5e-4, "a tracker registers to 0.05 to 0.3 mm, unless a step goes wrong"),
    Size("turn", 3e-4, "the same over the reflectors' distance"),
)
def base_placement(own: Effect, sites: Sites) -> Candidates:
    """A robot whose foot does not stand where the campaign declares it: a constant shift and turn.

    u = (d, r) at the foot in base axes, d in m and r in rad; a point p (m) moves by d + r x p. Where the placement of the base
    is unknown it is fitted, and there is nothing to misplace. A turn about a vertical first axis is the zero offset of joint 1.
    """
    six = moved_and_turned(own.size("shift", sites), own.size("turn", sites))
    yield own.candidate((), six, lambda around: [{c: around.always} for c in sites.base], {"declared base"})


# The reflector circles in its nest, and the flange does not.
@_effect("eccentric nest of the reflector", Size("shift", 5e-5, "a worn nest of a reflector"), moves_robot=False)
def nest_eccentricity(own: Effect, sites: Sites) -> Candidates:
    """A reflector whose centre is off the axis of its nest at the flange: it circles as the last joint turns.

    d = sum_e e (a_e cos 2q + b_e sin 2q) over the two axes e across the last joint, in the frame that turns with it; d, a_e and
    b_e in m, q the angle of that joint in rad. Derived here: of the Fourier series of d, order 0 is a target elsewhere and
    order 1, if it circles against the joint, a link of other dimensions; order 2 is the lowest of which neither makes a part,
    as of an oval ball or nest in which the reflector turns to face the tracker (Muralikrishnan et al. 2016).
    """
    last = sites.joints - 1
    if sites.prismatic[last]:
        return
    across, size = [axis for axis in range(3) if axis != sites.joint_axes[last]], own.size("shift", sites)
    parameters = [Parameter(f"{wave}_{'xyz'[axis]}_{_NEST_ORDER}q", "m", size, size) for axis in across for wave in WAVES]

    def law(around: Conditions) -> Displacements:
        turned, both = sites.link_rotations[last + 1].T, waves(around.joint_angles[:, last], _NEST_ORDER)
        shifts = [np.outer(turned[:, axis], wave) for axis in across for wave in both]
        return [dict(zip(sites.link_end[last + 1][:3], shift, strict=True)) for shift in shifts]

    yield own.candidate((), parameters, law, distinct_angles=_SAMPLES_PER_PERIOD * _NEST_ORDER, turning=(last + 1,))


# The tracker shows lengths that the robot does not have.
@_effect("scale error of the tracker", Size("scale", 2e-5, "20 K or 70 hPa of air that were not entered"), moves_robot=False)
def tracker_scale(own: Effect, sites: Sites) -> Candidates:
    """A tracker that measures all lengths too long or too short, by its wavelength in warm air or by a bad absolute distance.

    p' = (1 + s) p about the tracker, with p a position (m) and s the scale error (m/m) (Muralikrishnan et al. 2016). Scaled
    about the base positions differ from that by a shift of the frame, which is fitted where it is unknown; and a robot whose
    positions are all scaled about its base is one whose column, links and travels along a track are longer by that share.
    """

    def law(around: Conditions) -> Displacements:
        travels = {joint: around.joint_angles[:, joint] for joint, slides in enumerate(sites.prismatic) if slides}
        return [longer(sites, around.always) | travels]

    yield own.candidate((), own.parameters("scale", ["scale"], "m/m", sites), law)


def longer(sites: Sites, share: np.ndarray) -> dict[int, np.ndarray]:
    """Displacement by which the column and every link are longer by a share (S,), as a dict by coordinate."""
    return {
        coordinate: share * along
        for ends, vector in zip(sites.link_end, sites.link_vectors_m, strict=True)
        for coordinate, along in zip(ends[:3], vector, strict=True)
        if along
    }
