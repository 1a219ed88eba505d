"""Transmission: effects that are present without a load, by the angle of the joint."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import (
    WAVES,
    Parameter,
    Shape,
    effect,
    turning_joints,
    waves,
)
from elastocal.effects.sizes import Size

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "transmission")
_SAMPLES_PER_PERIOD = 4
_BANDS = ((1, 2), (3, 6), (7, 12), (13, 18), (19, 24), (25, 30), (31, 36))
# Nearer to an integer than the margin an order is not distinguishable from it.
_HIGHEST = 18
_MARGIN = 0.25
_WRIST = 3
# Any angles make the waves of the motor distinguishable; twice as many as there are of
# them, and some.
_ANGLES_OF_MOTOR = 12


@_effect(
    "gear transmission error",
    Size(
        "amplitude",
        2e-4,
        "gears are inspected for an arc minute (their catalogues)",
        most=1.0,
    ),
    at=lambda sites: [
        (joint, *band) for (joint,) in turning_joints(sites) for band in _BANDS
    ],
    formula=r"\theta_i = \sum_k a_k \cos k q_i + b_k \sin k q_i",
)
def transmission_harmonic(
    entry: Effect, sites: Sites, joint: int, low: int, high: int
) -> Candidates:
    """Transmission error of a gear, periodic in the angle of its joint: eccentric and
    uneven parts let it run ahead and behind.

    theta_i = sum_k a_k cos(k q_i) + b_k sin(k q_i), with theta_i, a_k, b_k and the
    joint angle q_i in rad. Orders 1 and 2 are an eccentric gear (Smith 2003) or
    encoder. Orders 3 to 36 are left by parts that pass so many times in a turn of the
    joint, and come in bands that are judged one by one; those of the motor's turns are
    `motor_eccentricity`.
    """
    # Over the part of a turn that a joint uses, neighbouring orders are nearly the same
    # function: without a prior they would cancel each other at a hundred times that.
    parameters = [
        replace(wave, prior_std=wave.plausible, order=order)
        for order in range(low, high + 1)
        for wave in entry.parameters(
            "amplitude", (f"cos_{order}q", f"sin_{order}q"), "rad", sites
        )
    ]

    def turns(around: Conditions) -> Iterator[np.ndarray]:
        # Powers of one complex exponential take a fifth of the time of as many cosines
        # and sines.
        turned, once = np.exp(
            1j * np.multiply.outer([low, 1], around.joint_angles[:, joint])
        )
        for _ in range(low, high + 1):
            yield from (turned.real.copy(), turned.imag.copy())
            turned = turned * once

    band = f"orders {low}-{high}"
    angles = _SAMPLES_PER_PERIOD * high
    yield entry.of_joint(
        joint,
        parameters,
        turns,
        detail=band,
        distinct_angles=angles,
        location_name=band,
        fixed=True,
    )


@_effect(
    "non-integer gear transmission error",
    Size(
        "amplitude",
        2e-4,
        "as whole orders: larger waves are another mechanism's, as a torque's",
        most=1.0,
    ),
    at=lambda sites: [
        (joint, above)
        for (joint,) in turning_joints(sites)
        for above in range(1, _HIGHEST)
    ],
    detail_words={
        f"order {above}-{above + 1}": f"order between {above} and {above + 1}"
        for above in range(1, _HIGHEST)
    },
    formula=(
        r"\theta_i = \sum_{m=1}^{2} a_m \cos m k q_i + b_m \sin m k q_i, \quad k "
        r"\notin \mathbb{N}"
    ),
)
def transmission_order(
    entry: Effect, sites: Sites, joint: int, above: int
) -> Candidates:
    """Transmission error of an order that is no integer: parts of a gear that do not
    come round with the joint.

    theta_i = sum_m a_m cos(m k q_i) + b_m sin(m k q_i), m = 1, 2, with theta_i, a_m,
    b_m and the joint angle q_i in rad and k between two integers: planets, cranks and
    cages turn by ratios of numbers of teeth (Müller 1982), and what is out of round
    errs twice in their turn as well, wherever twice k lies. Integers k are those of
    `transmission_harmonic`. Over the part of a turn that a joint uses neighbouring
    orders are nearly one function: the middle between two integers is where a search
    has to try.
    """
    shape = Shape(
        "order", "1", above + 0.5, above + _MARGIN, above + 1 - _MARGIN, tried=1
    )
    four = entry.parameters(
        "amplitude", ("cos_kq", "sin_kq", "cos_2kq", "sin_2kq"), "rad", sites
    )
    parameters = [
        replace(wave, order=(above + 1) * (1 + number // 2))
        for number, wave in enumerate(four)
    ]
    band = f"order {above}-{above + 1}"
    angles = _SAMPLES_PER_PERIOD * (above + 1)
    options = {
        "shapes": (shape,),
        "detail": band,
        "distinct_angles": angles,
        "location_name": band,
    }
    yield entry.of_joint(
        joint,
        parameters,
        lambda at, order: waves(order * at.joint_angles[:, joint], 1, 2),
        **options,
    )


def _driven(sites: Sites) -> list[tuple[int, list[int], str]]:
    """Each joint and the one before it, and each of the last two joints as driven
    through the first of the wrist alone."""
    n = sites.joints
    first = sites.joints - _WRIST
    through = [n - 2, n - 1] if first >= 0 and not any(sites.prismatic[first:]) else []
    own = [(joint, [joint, joint - 1][: joint + 1], "") for joint in range(n)]
    return [*own, *((joint, [first], f"from {first + 1}") for joint in through)]


@_effect(
    "gear ratio or coupling error",
    Size("per turn", 1e-3, "a parameter mistyped in its fourth digit"),
    at=_driven,
    detail_words={
        f"from {number}": f"coupling from joint {number} alone"
        for number in range(1, 10)
    },
    formula=r"\theta_i = e_i q_i + e_{ih} q_h, \quad h = i - 1",
)
def transmission_ratio(
    entry: Effect, sites: Sites, joint: int, sources: list[int], detail: str
) -> Candidates:
    """Wrong ratio of a gear, or coupling from a joint before it: the controller divides
    the motor's angle by a wrong number.

    theta_i = e_i q_i + e_ih q_h, h = i - 1, with theta and q in rad and e in rad/rad (m
    and m/m for prismatic joints): linear in the angle and not periodic. Derived here: a
    motor turns by N_i q_i + N_ih q_h, with errors of both numbers. In a wrist whose
    last two motors sit in the forearm and drive through hollow shafts both joints
    follow the first wrist joint: as an alternative theta_i = e_ih q_h alone, with h
    that joint.
    """
    # A spindle has a pitch of its own, but is not coupled to what turns.
    alike = [
        source
        for source in sources
        if sites.prismatic[source] == sites.prismatic[joint]
    ]
    unit = "m/m" if sites.prismatic[joint] else "rad/rad"
    per = entry.parameters(
        "per turn", [f"per_q{source + 1}" for source in alike], unit, sites
    )
    yield entry.of_joint(
        joint,
        per,
        lambda around: [around.joint_angles[:, q] for q in alike],
        detail=detail,
        fixed=True,
    )


@_effect(
    "motor eccentricity",
    Size("amplitude", 5e-5, "milliradians at the motor, over a ratio of a hundred"),
    at=turning_joints,
    formula=r"\theta_i = \sum_{k=1}^{2} a_k \cos k N q_i + b_k \sin k N q_i",
)
def motor_eccentricity(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """An eccentric motor, resolver or input pinion: transmission error once and twice
    per turn of the motor.

    theta_i = sum_k a_k cos(k N q_i) + b_k sin(k N q_i), k = 1, 2, with theta_i, a_k,
    b_k and the joint angle q_i in rad and N the gear ratio, which must be known well
    enough for the phase of its waves. Strain wave gears, too, err in the rhythm of
    their input (Tuttle 1992). Where the robot file has no gear ratio of a joint nothing
    is offered there.
    """
    ratio = sites.gear_ratio[joint] if sites.gear_ratio else None
    if ratio is None:
        return
    size = entry.size("amplitude", sites)
    options = {"distinct_angles": _ANGLES_OF_MOTOR, "fixed": True}
    parameters = [
        Parameter(f"{wave}_{order}_motor", "rad", size)
        for order in (1, 2)
        for wave in WAVES
    ]
    yield entry.of_joint(
        joint,
        parameters,
        lambda around: waves(ratio * around.joint_angles[:, joint], 1, 2),
        **options,
    )


@_effect(
    "bearing runout",
    Size("shift", 5e-5, "slewing bearings run out by hundredths of a millimetre"),
    Size("wobble", 5e-5, "the same over the diameter of the bearing"),
    at=lambda sites: [
        (joint, motion)
        for motion in ("radial", "axial", "wobble")
        for (joint,) in turning_joints(sites)
    ],
    formula=r"e = \sum_{k=1}^{2} a_k \cos k q + b_k \sin k q",
)
def bearing_runout(entry: Effect, sites: Sites, joint: int, motion: str) -> Candidates:
    """A bearing that runs out: races or seats that are out of round or askew move the
    axis of a joint once and twice per turn.

    e = sum_k a_k cos(k q) + b_k sin(k q), k = 1, 2, with q the joint angle (rad), is
    each of the error motions of an axis of rotation (ISO 230-7): radial along two fixed
    axes across it (m), axial along it (m), and tilt about the two (rad). Fixed axes are
    those of the link before the joint.
    """
    wobbles = motion == "wobble"
    along = sites.joint_axes[joint]
    axes = (along,) if motion == "axial" else ((along + 1) % 3, (along + 2) % 3)
    # Over the part of a turn that a joint uses the two orders are nearly one function,
    # and like a link of other dimensions: a prior of that size keeps them from
    # cancelling each other.
    size = entry.size("wobble" if wobbles else "shift", sites)
    unit = "rad" if wobbles else "m"
    names = [
        f"{motion}_{'xyz'[axis]}_{wave}_{order}q"
        for axis in axes
        for order in (1, 2)
        for wave in WAVES
    ]

    def law(around: Conditions) -> Displacements:
        angle = around.joint_angles[:, joint]
        fixed = [_seen_behind(sites, joint, axis, angle) for axis in axes]
        moved = [direction * wave for direction in fixed for wave in waves(angle, 1, 2)]
        if wobbles:
            return [dict(zip(sites.tilt[joint], turn, strict=True)) for turn in moved]
        # A link shifts as its far end does.
        end = sites.link_end[joint + 1][:3]
        turned = sites.link_rotations[joint + 1].T
        return [dict(zip(end, turned @ shift, strict=True)) for shift in moved]

    parameters = [Parameter(name, unit, size, size) for name in names]
    at = (joint + 1,)
    angles = _SAMPLES_PER_PERIOD * 2
    yield entry.candidate(
        at,
        parameters,
        law,
        detail=motion,
        distinct_angles=angles,
        location_name=motion,
        fixed=True,
    )


def _seen_behind(sites: Sites, joint: int, axis: int, angle: np.ndarray) -> np.ndarray:
    """Unit vector along an axis of the frame before a joint, in the frame that turns
    with it, ndarray (3, S)."""
    about, along = np.eye(3)[[sites.joint_axes[joint], axis]]
    turned = -sites.joint_signs[joint] * angle
    lengthwise = about * (about @ along)
    # Rodrigues.
    across = np.outer(along - lengthwise, np.cos(turned)) + np.outer(
        np.cross(about, along), np.sin(turned)
    )
    return lengthwise[:, None] + across
