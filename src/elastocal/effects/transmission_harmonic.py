"""Transmission error of a gear, periodic in the angle of its joint: eccentric and uneven parts let it run ahead and behind.

theta_i = sum_k a_k cos(k q_i) + b_k sin(k q_i), with theta_i, a_k, b_k and the joint angle q_i in rad. Orders 1 and 2 are an
eccentric gear [1] or encoder. Orders 3 to 36 are left by parts that pass so many times in a turn of the joint, and come in
bands that are judged one by one; those of the motor's turns are `motor_eccentricity`.

[1] J. D. Smith, Gear Noise and Vibration, 2nd edition, Marcel Dekker, 2003.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "transmission_harmonic", "transmission"
MOVES_ROBOT = True
WORDS = "gear transmission error"
_BANDS = ((1, 2), (3, 6), (7, 12), (13, 18), (19, 24), (25, 30), (31, 36))
_SAMPLES_PER_PERIOD = 4
# Over the part of a turn that a joint uses, neighbouring orders are nearly
# the same function: without a prior they would cancel each other at a hundred times that.


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint and band of orders."""
    return [
        _candidate(sites, joint, low, high)
        for joint in range(sites.joints)
        if not sites.prismatic[joint]
        for low, high in _BANDS
    ]


def _candidate(sites: Sites, joint: int, low: int, high: int) -> Candidate:
    orders = range(low, high + 1)
    parameters = tuple(
        replace(wave, prior_std=wave.plausible, order=order)
        for order in orders
        for wave in sized(NAME, "amplitude", (f"cos_{order}q", f"sin_{order}q"), "rad", sites)
    )

    def displacement(conditions: Conditions) -> Displacements:
        # Powers of one complex exponential take a fifth of the time of as many cosines and sines.
        turned, once = np.exp(1j * np.multiply.outer([low, 1], conditions.joint_angles[:, joint]))
        waves = []
        for _ in orders:
            waves += [{joint: turned.real.copy()}, {joint: turned.imag.copy()}]
            turned = turned * once
        return waves

    detail, angles = f"orders {low}-{high}", _SAMPLES_PER_PERIOD * high
    at = NAME, FAMILY, (joint + 1,), detail
    return Candidate(*at, parameters, displacement, distinct_angles=angles, location_name=detail, fixed=True)
