"""A reflector whose centre is off the axis of its nest at the flange: it circles as the last joint turns.

d = sum_e e (a_e cos 2q + b_e sin 2q) over the two axes e across the last joint, in the frame that turns with it; d, a_e and
b_e in m, q the angle of that joint in rad. Derived here: of the Fourier series of d, order 0 is a target elsewhere and order
1, if it circles against the joint, a link of other dimensions; order 2 is the lowest of which neither makes a part, as of an
oval ball or nest in which the reflector turns to face the tracker. How well reflectors are centred is one of the errors of
trackers [1].

[1] B. Muralikrishnan, S. Phillips and D. Sawyer, Laser trackers for large-scale dimensional metrology: a review, Precision
    Engineering 44, 2016.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter
from elastocal.effects.sizes import size_of

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "nest_eccentricity", "geometry"
# The reflector circles in its nest, and the flange does not.
MOVES_ROBOT = False
WORDS = "eccentric nest of the reflector"
_ORDER, _SAMPLES_PER_PERIOD = 2, 4


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate, where the last joint turns."""
    last = sites.joints - 1
    if sites.prismatic[last]:
        return []
    across = [axis for axis in range(3) if axis != sites.joint_axes[last]]
    size = size_of(NAME, "shift", sites)
    parameters = tuple(
        Parameter(f"{wave}_{'xyz'[axis]}_{_ORDER}q", "m", size, size) for axis in across for wave in ("cos", "sin")
    )

    def displacement(conditions: Conditions) -> Displacements:
        angle = _ORDER * conditions.joint_angles[:, last]
        turned = sites.link_rotations[last + 1].T
        return [
            dict(zip(sites.link_end[last + 1][:3], np.outer(turned[:, axis], wave(angle)), strict=True))
            for axis in across
            for wave in (np.cos, np.sin)
        ]

    distinct = _SAMPLES_PER_PERIOD * _ORDER
    return [Candidate(NAME, FAMILY, (), "", parameters, displacement, distinct_angles=distinct, turning=(last + 1,))]
