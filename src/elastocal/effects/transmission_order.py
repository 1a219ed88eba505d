"""Transmission error of an order that is no integer: parts of a gear that do not come round with the joint.

theta_i = a cos(k q_i) + b sin(k q_i), with theta_i, a, b and the joint angle q_i in rad and k between two integers: planets,
cranks and cages turn by ratios of numbers of teeth [1]. Integers themselves are those of `transmission_harmonic`. Over the
part of a turn that a joint uses, orders nearer than half a wave over that part are nearly one function, so that the middle
between two integers is where a search has to try; and less than a whole wave in a turn would be nearly any smooth function.

[1] H. W. Müller, Epicyclic Drive Trains, Wayne State University Press, 1982.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Shape
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "transmission_order", "transmission"
MOVES_ROBOT = True
WORDS = "non-integer gear transmission error"
_HIGHEST = 18
DETAIL_WORDS = {f"order {above}-{above + 1}": f"order between {above} and {above + 1}" for above in range(1, _HIGHEST)}
# Nearer to an integer than this an order is not distinguishable from it.
_MARGIN = 0.25
_SAMPLES_PER_PERIOD = 4


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a joint and interval between two integers."""
    revolute = [joint for joint in range(sites.joints) if not sites.prismatic[joint]]
    return [_candidate(sites, joint, above) for joint in revolute for above in range(1, _HIGHEST)]


def _candidate(sites: Sites, joint: int, above: int) -> Candidate:
    order = Shape("order", "1", above + 0.5, above + _MARGIN, above + 1 - _MARGIN, tried=1)
    waves = sized(NAME, "amplitude", ("cos_kq", "sin_kq"), "rad", sites)
    parameters = tuple(replace(wave, order=above + 1) for wave in waves)

    def displacement(conditions: Conditions, order: float) -> Displacements:
        angle = order * conditions.joint_angles[:, joint]
        return [{joint: np.cos(angle)}, {joint: np.sin(angle)}]

    detail, angles = f"order {above}-{above + 1}", _SAMPLES_PER_PERIOD * (above + 1)
    return Candidate(
        NAME,
        FAMILY,
        (joint + 1,),
        detail,
        parameters,
        displacement,
        shapes=(order,),
        distinct_angles=angles,
        location_name=detail,
    )
