"""Effects of the transmission, which depend on the joint angle and need no load."""

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
from elastocal.effects.sizes import OVER_WIDTH, Size

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Candidates, Displacements, Effect
    from elastocal.mechanics.sites import Sites

_effect = partial(effect, "transmission")
# Different angles that a wave needs in each of its periods.
_SAMPLES_PER_PERIOD = 4
_BANDS = ((1, 2), (3, 6), (7, 12), (13, 18), (19, 24), (25, 30), (31, 36))
# Upper bound on orders that are not integers.
_HIGHEST = 18
# An order that is closer to an integer cannot be distinguished from it.
_MARGIN = 0.25
# Number of joints of a wrist.
_WRIST = 3
# Different angles that the waves of a motor need: a little more than twice their number.
# Any angles make them distinguishable from a smooth function.
_ANGLES_OF_MOTOR = 12


@_effect(
    "gear transmission error",
    Size(
        "amplitude",
        2e-4,
        "catalogues of gears guarantee an arc minute",
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
    """Transmission error of a gear, periodic in the joint angle, by eccentric and uneven
    parts.

    theta_i = sum_k a_k cos(k q_i) + b_k sin(k q_i), with theta_i, a_k, b_k and the
    joint angle q_i in rad. Orders 1 and 2 are caused by an eccentric gear (Smith
    2003) or encoder, orders 3 to 36 by parts that pass that often in a turn of the joint.
    Orders come in bands, each of which is tested separately. Waves in the motor angle are
    the effect `motor_eccentricity`.
    """
    # Over the range of a joint, neighbouring orders are nearly the same function. Without a
    # prior, a fit could make them a hundred times as large, so that they cancel.
    parameters = [
        replace(wave, prior_std=wave.plausible, order=order)
        for order in range(low, high + 1)
        for wave in entry.parameters(
            "amplitude", (f"cos_{order}q", f"sin_{order}q"), "rad", sites
        )
    ]

    def turns(conditions: Conditions) -> Iterator[np.ndarray]:
        # Powers of one complex exponential take a fifth of the time of all cosines and
        # sines.
        power, base = np.exp(
            1j * np.multiply.outer([low, 1], conditions.joint_angles[:, joint])
        )
        for _ in range(low, high + 1):
            yield power.real.copy()
            yield power.imag.copy()
            power = power * base

    band = f"orders {low}-{high}"
    yield entry.of_joint(
        joint,
        parameters,
        turns,
        detail=band,
        distinct_angles=_SAMPLES_PER_PERIOD * high,
        location_name=band,
        fixed=True,
    )


@_effect(
    "non-integer gear transmission error",
    Size(
        "amplitude",
        2e-4,
        "as integer orders; larger waves have another cause, such as a torque",
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
    """Transmission error of non-integer order, by parts of a gear that do not return to
    their position with every turn of the joint.

    theta_i = sum_m a_m cos(m k q_i) + b_m sin(m k q_i), m = 1, 2, with theta_i, a_m,
    b_m and the joint angle q_i in rad and k between two integers: planets, cranks and
    cages turn by ratios of numbers of teeth (Müller 1982). A part that is out of round
    also has a wave twice per turn, of order 2 k. Integer orders are the effect
    `transmission_harmonic`. Over the range of a joint, neighbouring orders are nearly the
    same function, so that a search only needs to try the middle between two integers.
    """
    shape = Shape(
        "order", "1", above + 0.5, above + _MARGIN, above + 1 - _MARGIN, tried=1
    )
    parameters = [
        replace(wave, order=(above + 1) * multiple)
        for multiple, names in enumerate(
            (("cos_kq", "sin_kq"), ("cos_2kq", "sin_2kq")), 1
        )
        for wave in entry.parameters("amplitude", names, "rad", sites)
    ]
    band = f"order {above}-{above + 1}"
    yield entry.of_joint(
        joint,
        parameters,
        lambda conditions, order: waves(
            order * conditions.joint_angles[:, joint], 1, 2
        ),
        shapes=(shape,),
        detail=band,
        distinct_angles=_SAMPLES_PER_PERIOD * (above + 1),
        location_name=band,
    )


def _list_drives(sites: Sites) -> list[tuple[int, list[int], str]]:
    """List each joint with the joints on whose angles its motor may depend: itself and the
    joint before it. For the last two joints of a revolute wrist, also list the first wrist
    joint alone."""
    drives = [
        (joint, [joint, joint - 1][: joint + 1], "") for joint in range(sites.joints)
    ]
    first = sites.joints - _WRIST
    if first >= 0 and not any(sites.prismatic[first:]):
        coupling = f"from {first + 1}"
        drives += [(joint, [first], coupling) for joint in (first + 1, first + 2)]
    return drives


@_effect(
    "gear ratio or coupling error",
    Size("per turn", 1e-3, "a parameter with a typing error in its fourth digit"),
    at=_list_drives,
    detail_words={
        f"from {number}": f"coupling from joint {number} alone"
        for number in range(1, 10)
    },
    formula=r"\theta_i = e_i q_i + e_{ih} q_h, \quad h = i - 1",
)
def transmission_ratio(
    entry: Effect, sites: Sites, joint: int, sources: list[int], detail: str
) -> Candidates:
    """Wrong ratio of a gear, or coupling from the joint before it: the controller divides
    the motor angle by a wrong number.

    theta_i = e_i q_i + e_ih q_h, h = i - 1, with theta and q in rad and e in rad/rad (m
    and m/m for prismatic joints): linear in the angle and not periodic. Derived here: a
    motor turns by N_i q_i + N_ih q_h, with errors of both numbers. In a wrist whose last
    two motors are in the forearm and drive through hollow shafts, both joints follow the
    first wrist joint h: the alternative law is theta_i = e_ih q_h alone.
    """
    # A spindle has its own pitch, but is not coupled to revolute joints.
    coupled = [
        source
        for source in sources
        if sites.prismatic[source] == sites.prismatic[joint]
    ]
    unit = "m/m" if sites.prismatic[joint] else "rad/rad"
    errors = entry.parameters(
        "per turn", [f"per_q{source + 1}" for source in coupled], unit, sites
    )
    yield entry.of_joint(
        joint,
        errors,
        lambda conditions: [conditions.joint_angles[:, source] for source in coupled],
        detail=detail,
        fixed=True,
    )


@_effect(
    "motor eccentricity",
    Size(
        "amplitude", 5e-5, "milliradians at the motor, divided by a ratio of a hundred"
    ),
    at=turning_joints,
    formula=r"\theta_i = \sum_{k=1}^{2} a_k \cos k N q_i + b_k \sin k N q_i",
)
def motor_eccentricity(entry: Effect, sites: Sites, joint: int) -> Candidates:
    """An eccentric motor, resolver or input pinion: a transmission error once and twice per
    turn of the motor.

    theta_i = sum_k a_k cos(k N q_i) + b_k sin(k N q_i), k = 1, 2, with theta_i, a_k,
    b_k and the joint angle q_i in rad and N the gear ratio, which must be known well
    enough for the phase of the waves. Strain wave gears also have errors that are periodic
    in their input (Tuttle 1992). If the robot file has no gear ratio of a joint, the joint
    has no such candidate.
    """
    ratio = sites.gear_ratio[joint] if sites.gear_ratio else None
    if ratio is None:
        return
    size = entry.size("amplitude", sites)
    parameters = [
        Parameter(f"{wave}_{order}_motor", "rad", size)
        for order in (1, 2)
        for wave in WAVES
    ]
    yield entry.of_joint(
        joint,
        parameters,
        lambda conditions: waves(ratio * conditions.joint_angles[:, joint], 1, 2),
        distinct_angles=_ANGLES_OF_MOTOR,
        fixed=True,
    )


@_effect(
    "bearing runout",
    Size("shift", 5e-5, "slewing bearings have hundredths of a millimetre"),
    Size("wobble", 5e-5, "the same over the diameter of the bearing", of=OVER_WIDTH),
    at=lambda sites: [
        (joint, motion)
        for motion in ("radial", "axial", "wobble")
        for (joint,) in turning_joints(sites)
    ],
    formula=r"e = \sum_{k=1}^{2} a_k \cos k q + b_k \sin k q",
)
def bearing_runout(entry: Effect, sites: Sites, joint: int, motion: str) -> Candidates:
    """Runout of a bearing: races or seats that are out of round or tilted move the joint
    axis once and twice per turn.

    e = sum_k a_k cos(k q) + b_k sin(k q), k = 1, 2, with q the joint angle (rad), is
    each of the error motions of an axis of rotation (ISO 230-7): radial along two fixed
    axes across it (m), axial along it (m), and tilt about the two (rad). Fixed axes belong
    to the link before the joint.
    """
    wobbles = motion == "wobble"
    along = sites.joint_axes[joint]
    axes = (along,) if motion == "axial" else ((along + 1) % 3, (along + 2) % 3)
    # Over the range of a joint, the two orders are nearly the same function, and similar to
    # a geometric error of the link. The prior keeps them from cancelling each other.
    size = entry.size("wobble" if wobbles else "shift", sites)
    unit = "rad" if wobbles else "m"
    names = [
        f"{motion}_{'xyz'[axis]}_{wave}_{order}q"
        for axis in axes
        for order in (1, 2)
        for wave in WAVES
    ]

    def law(conditions: Conditions) -> Displacements:
        angle = conditions.joint_angles[:, joint]
        directions = [_express_behind_joint(sites, joint, axis, angle) for axis in axes]
        errors = [
            direction * wave for direction in directions for wave in waves(angle, 1, 2)
        ]
        if wobbles:
            return [dict(zip(sites.tilt[joint], tilt, strict=True)) for tilt in errors]
        # The far end of the link shifts as its bearing does.
        end = sites.link_end[joint + 1][:3]
        to_link = sites.link_rotations[joint + 1].T
        return [dict(zip(end, to_link @ shift, strict=True)) for shift in errors]

    parameters = [Parameter(name, unit, size, size) for name in names]
    yield entry.candidate(
        (joint + 1,),
        parameters,
        law,
        detail=motion,
        distinct_angles=_SAMPLES_PER_PERIOD * 2,
        location_name=motion,
        fixed=True,
    )


def _express_behind_joint(
    sites: Sites, joint: int, axis: int, angle: np.ndarray
) -> np.ndarray:
    """Express a unit vector along an axis of the frame before a joint in the frame behind
    the joint, ndarray (3, S), by Rodrigues' formula."""
    joint_axis, direction = np.eye(3)[[sites.joint_axes[joint], axis]]
    rotation_angle = -sites.joint_signs[joint] * angle
    along = joint_axis * (joint_axis @ direction)
    across = np.outer(direction - along, np.cos(rotation_angle)) + np.outer(
        np.cross(joint_axis, direction), np.sin(rotation_angle)
    )
    return along[:, None] + across
