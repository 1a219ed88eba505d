"""A bearing that runs out: races or seats that are out of round or askew move the axis of a joint once and twice per turn.

e = sum_k a_k cos(k q) + b_k sin(k q), k = 1, 2, with q the joint angle (rad), is each of the error motions of an axis of
rotation [1]: radial along two fixed axes across it (m), axial along it (m), and tilt about the two (rad). Fixed axes are
those of the link before the joint.

[1] ISO 230-7, Test code for machine tools, part 7: Geometric accuracy of axes of rotation, 2015.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, per_joint
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "bearing_runout", "transmission"
MOVES_ROBOT = True
WORDS = "bearing runout"
_ORDERS = (1, 2)
_WAVES = (("cos", np.cos), ("sin", np.sin))
_SAMPLES_PER_PERIOD = 4
# Over the part of a turn that a joint uses the two orders
# are nearly one function, and like a link of other dimensions: a prior of that size keeps them from cancelling each other.


def candidates(sites: Sites) -> list[Candidate]:
    """Three candidates a joint: radial, axial, and wobble."""
    return [
        *per_joint(sites, lambda joint: _candidate(sites, joint, "radial")),
        *per_joint(sites, lambda joint: _candidate(sites, joint, "axial")),
        *per_joint(sites, lambda joint: _candidate(sites, joint, "wobble")),
    ]


def _candidate(sites: Sites, joint: int, motion: str) -> Candidate:
    own = sites.joint_axes[joint]
    axes = (own,) if motion == "axial" else ((own + 1) % 3, (own + 2) % 3)
    unit, quantity = ("rad", "wobble") if motion == "wobble" else ("m", "shift")
    size = size_of(NAME, quantity, sites)
    parameters = tuple(
        Parameter(f"{motion}_{'xyz'[axis]}_{name}_{order}q", unit, size, size)
        for axis in axes
        for order in _ORDERS
        for name, _ in _WAVES
    )

    def displacement(conditions: Conditions) -> Displacements:
        angle = conditions.joint_angles[:, joint]
        fixed = [_seen_behind(sites, joint, axis, angle) for axis in axes]
        return [
            _at(sites, joint, motion, direction * wave(order * angle))
            for direction in fixed
            for order in _ORDERS
            for _, wave in _WAVES
        ]

    distinct = _SAMPLES_PER_PERIOD * max(_ORDERS)
    return Candidate(
        NAME, FAMILY, (joint + 1,), motion, parameters, displacement, distinct_angles=distinct, location_name=motion, fixed=True
    )


def _seen_behind(sites: Sites, joint: int, axis: int, angle: np.ndarray) -> np.ndarray:
    """Unit vector along an axis of the frame before a joint, in the frame that turns with it, ndarray (3, S)."""
    own, turned = sites.joint_axes[joint], sites.joint_signs[joint] * angle
    seen = np.zeros((3, len(angle)))
    if axis == own:
        seen[axis] = 1.0
    else:
        # R(-turned) e_axis: the other axis across follows or goes before it.
        other = 3 - own - axis
        ahead = 1.0 if (own + 1) % 3 == axis else -1.0
        seen[axis], seen[other] = np.cos(turned), -ahead * np.sin(turned)
    return seen


def _at(sites: Sites, joint: int, motion: str, vector: np.ndarray) -> dict[int, np.ndarray]:
    """A shift or turn (3, S) just behind a joint, in the frame there, on coordinates: a link shifts as its far end does."""
    if motion == "wobble":
        return dict(zip(sites.tilt[joint], vector, strict=True))
    shifted = sites.link_rotations[joint + 1].T @ vector
    return dict(zip(sites.link_end[joint + 1][:3], shifted, strict=True))
