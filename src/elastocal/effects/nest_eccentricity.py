"""A reflector whose centre is off the axis of its nest at the flange: it circles as the last joint turns.

Spherically mounted reflectors are centred to some hundredths of a millimetre at best (Muralikrishnan, Phillips and Sawyer
2016), worn or magnetic nests less well. What circles once a turn is like a target elsewhere or a link of other dimensions;
twice a turn, seen from the flange, is what the reflector does that keeps looking at the tracker.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "nest_eccentricity", "geometry"
WORDS = "eccentric nest of the reflector"
_SIZE_M = 5e-5
_ORDER, _SAMPLES_PER_PERIOD = 2, 4


def candidates(sites):
    """One candidate, where the last joint turns."""
    last = sites.joints - 1
    if sites.prismatic[last]:
        return []
    across = [axis for axis in range(3) if axis != sites.joint_axes[last]]
    parameters = tuple(
        Parameter(f"{wave}_{'xyz'[axis]}_{_ORDER}q", "m", _SIZE_M, _SIZE_M) for axis in across for wave in ("cos", "sin")
    )

    def displacement(conditions):
        angle = _ORDER * conditions.joint_angles[:, last]
        turned = sites.link_rotations[last + 1].T
        return [
            dict(zip(sites.link_end[last + 1][:3], np.outer(turned[:, axis], wave(angle)), strict=True))
            for axis in across
            for wave in (np.cos, np.sin)
        ]

    distinct = _SAMPLES_PER_PERIOD * _ORDER
    return [Candidate(NAME, FAMILY, (), "", parameters, displacement, distinct_angles=distinct, turning=(last + 1,))]
