"""Transmission error of a gear, periodic in the angle of its joint: theta_i = sum_k a_k cos(k q_i) + b_k sin(k q_i).

Catalogue row 15. Orders 1 and 2 are an eccentric gear or encoder; the higher orders are what tooth meshes, the wave generator
of a strain wave gear and its supports leave, and come in bands that are judged one by one.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "transmission_harmonic", "transmission"
WORDS = "gear transmission error"
_BANDS = ((1, 2), (3, 6), (7, 12), (13, 18), (19, 24), (25, 30), (31, 36))
_SAMPLES_PER_PERIOD = 4
# Gears of robots err by up to about an arc minute. Over the part of a turn that a joint uses, neighbouring orders are nearly
# the same function: without a prior they would cancel each other at a hundred times that.
_AMPLITUDE_RAD = 2e-4


def candidates(sites):
    """One candidate a joint and band of orders."""
    return [_candidate(joint, low, high) for joint in range(sites.joints) if not sites.prismatic[joint] for low, high in _BANDS]


def _candidate(joint, low, high):
    orders = range(low, high + 1)
    parameters = tuple(
        Parameter(f"{wave}_{order}q", "rad", _AMPLITUDE_RAD, _AMPLITUDE_RAD, order=order)
        for order in orders
        for wave in ("cos", "sin")
    )

    def displacement(conditions):
        angle = conditions.joint_angles[:, joint]
        return [{joint: wave(order * angle)} for order in orders for wave in (np.cos, np.sin)]

    detail, angles = f"orders {low}-{high}", _SAMPLES_PER_PERIOD * high
    return Candidate(NAME, FAMILY, (joint + 1,), detail, parameters, displacement, distinct_angles=angles, location_name=detail)
