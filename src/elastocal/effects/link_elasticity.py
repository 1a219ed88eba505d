"""A link that bends and twists: a cantilever between two joints.

y = F_y l^3 a/EI + M_z l^2 b/EI, r_z = F_y l^2 b/EI + M_z l c/EI, likewise in the other plane, r_x = M_x l c/GJ,

are shift (m) and turns (rad) of the far end under force F (N) and moment M (N m) there, with x along the link of length l (m):
Euler-Bernoulli and St Venant [1], linear in 1/EI and 1/GJ, 1/(N m^2), at the near end. A uniform link has a, b, c = 1/3, 1/2,
1; one whose diameter falls linearly by a share t to its far end, thin-walled, the integrals over s from 0 to 1 of (1 - s)^2,
1 - s and 1 over (1 - t s)^3. Stretching and shear are left out, for they are small in links much longer than wide.

[1] S. P. Timoshenko and J. M. Gere, Mechanics of Materials, Van Nostrand Reinhold, 1972.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter, Shape

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "link_elasticity", "elastic"
MOVES_ROBOT = True
WORDS = "elastic bending and torsion"
PART = "link"
DETAIL_WORDS = {"one section": "all of one cross-section"}
# One per mille of the bending compliance of a solid steel rod of 0.1 m is 1e-9; thin-walled cast arms reach 1e-6.
_PARAMETERS = tuple(Parameter(name, "1/(N m^2)", 3e-7, sign=1) for name in ("bending_1_over_EI", "torsion_1_over_GJ"))
_SHORTEST_M = 0.05
# Arms get thinner towards the wrist.
_TAPER = Shape("taper", "1", 0.3, 0.0, 0.6, tried=1)
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def candidates(sites: Sites) -> list[Candidate]:
    """One candidate a link with a length, named by the joint before it; the column; and all links with one section.

    One section is what a robot of like tubes has: two parameters for the whole arm, where a candidate a link has two each.
    """
    long = [k for k in range(sites.joints + 1) if np.linalg.norm(sites.link_vectors_m[k]) > _SHORTEST_M]
    each = [_candidate(sites, (link,), "" if link else "column") for link in long]
    return [*each, _candidate(sites, tuple(long), "one section")] if len(long) > 1 else each


def _candidate(sites: Sites, links: tuple[int, ...], detail: str) -> Candidate:
    # A fit asks for the same taper under one load after the other.
    compliances = lru_cache(maxsize=4)(lambda taper: [_end_compliance(sites, link, taper) for link in links])

    def displacement(conditions: Conditions, taper: float) -> Displacements:
        bent: dict[int, np.ndarray] = {}
        twisted: dict[int, np.ndarray] = {}
        load = conditions.total.T
        for link, (bending, torsion) in zip(links, compliances(float(taper)), strict=True):
            coordinates = sites.link_end[link]
            wrench = load[list(coordinates)]
            bent |= zip(coordinates, bending @ wrench, strict=True)
            twisted |= zip(coordinates[3:], torsion @ wrench[3:], strict=True)
        return [bent, twisted]

    joints = tuple(k for k in links if k)
    return Candidate(
        NAME, FAMILY, joints, detail, _PARAMETERS, displacement, frozenset({"load"}), (_TAPER,), location_name=detail
    )


def _end_compliance(sites: Sites, link: int, taper: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the far end of a link by its wrench for a unit of 1/EI, (6, 6), and its turn by the moment for 1/GJ."""
    shift_by_force, by_either, turn_by_moment = _flexibilities(taper)
    length = np.linalg.norm(sites.link_vectors_m[link])
    along = sites.link_vectors_m[link] / length
    lengthwise = np.outer(along, along)
    across, turned = np.eye(3) - lengthwise, np.cross(np.eye(3), along).T * by_either * length**2
    bending = np.block(
        [[shift_by_force * length**3 * across, turned @ across], [-turned @ across, turn_by_moment * length * across]]
    )
    return bending, turn_by_moment * length * lengthwise


def _flexibilities(taper: float) -> list[float]:
    """a, b and c of a link whose diameter falls by a share."""
    places = 0.5 * (1.0 + _NODES)
    softer = 0.5 * _WEIGHTS / (1.0 - taper * places) ** 3
    return [float(softer @ (1.0 - places) ** power) for power in (2, 1, 0)]
