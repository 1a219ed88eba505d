"""Transmission error of an order that is no integer: parts of a gear that do not come round with the joint.

theta_i = a cos(k q_i) + b sin(k q_i) with k anywhere in a band: planets, cranks and cages turn by ratios of numbers of teeth.
Over the part of a turn that a joint uses, orders nearer than half a wave over that part are nearly one function.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, Shape

NAME, FAMILY = "transmission_order", "transmission"
# Lowest and highest order of each band.
_BANDS = ((1.0, 6.0), (6.0, 12.0), (12.0, 36.0))
_SAMPLES_PER_PERIOD = 4
_AMPLITUDE_RAD = 2e-4
# Half a wave over two thirds of a turn.
_STEP = 0.75


def candidates(sites):
    """One candidate a joint and band."""
    return [_candidate(joint, low, high) for joint in range(sites.joints) if not sites.prismatic[joint] for low, high in _BANDS]


def _candidate(joint, low, high):
    order = Shape("order", "1", (low + high) / 2, low, high, tried=1 + round((high - low) / _STEP))
    parameters = tuple(Parameter(f"{wave}_kq", "rad", _AMPLITUDE_RAD) for wave in ("cos", "sin"))

    def displacement(circumstances, order):
        angle = order * circumstances.joint_angles[:, joint]
        return [{joint: np.cos(angle)}, {joint: np.sin(angle)}]

    detail = f"orders {low:g}-{high:g}"
    distinct = round(_SAMPLES_PER_PERIOD * high)
    return Candidate(NAME, FAMILY, (joint + 1,), detail, parameters, displacement, shapes=(order,), distinct_angles=distinct)
