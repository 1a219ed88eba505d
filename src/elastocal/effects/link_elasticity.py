"""A link that bends and twists: a cantilever between two joints.

y = F_y l^3 a/EI + M_z l^2 b/EI, r_z = F_y l^2 b/EI + M_z l c/EI, likewise in the other plane, r_x = M_x l c/GJ,

are shift (m) and turns (rad) of the far end under force F (N) and moment M (N m) there, with x along the link of length l (m):
Euler-Bernoulli and St Venant [1]. A uniform link has a, b, c = 1/3, 1/2, 1; one whose diameter falls linearly by a share t to
its far end, thin-walled, the integrals over s from 0 to 1 of (1 - s)^2, 1 - s and 1 over (1 - t s)^3. Linear in 1/EI and 1/GJ,
1/(N m^2), of the uniform link that a force shifts and a moment along twists as far: so what is estimated of the size hardly
depends on the taper. Stretching and shear are left out, for they are small in links much longer than wide.

[1] S. P. Timoshenko and J. M. Gere, Mechanics of Materials, Van Nostrand Reinhold, 1972.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.protocol import Candidate, Shape, load_behind
from elastocal.effects.sizes import sized

if TYPE_CHECKING:
    from elastocal.effects.conditions import Conditions
    from elastocal.effects.protocol import Displacements
    from elastocal.mechanics.sites import Sites

NAME, FAMILY = "link_elasticity", "elastic"
MOVES_ROBOT = True
WORDS = "elastic bending and torsion"
PART = "link"
DETAIL_WORDS = {"one section": "all of one cross-section"}
_NAMES = ("bending_1_over_EI", "torsion_1_over_GJ")
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
    longest = max(links, key=lambda k: float(np.linalg.norm(sites.link_vectors_m[k])))
    length = float(np.linalg.norm(sites.link_vectors_m[longest]))
    parameters = sized(NAME, "1/EI", _NAMES, "1/(N m^2)", sites, max(longest - 1, 0), over=length)
    return Candidate(
        NAME, FAMILY, joints, detail, parameters, displacement, load_behind(sites, max(links)), (_TAPER,), location_name=detail
    )


def _end_compliance(sites: Sites, link: int, taper: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of the far end of a link by its wrench for a unit of 1/EI, (6, 6), and its turn by the moment for 1/GJ."""
    by_either, turn_by_moment = _flexibilities(taper)
    length = np.linalg.norm(sites.link_vectors_m[link])
    along = sites.link_vectors_m[link] / length
    lengthwise = np.outer(along, along)
    across, turned = np.eye(3) - lengthwise, np.cross(np.eye(3), along).T * by_either * length**2
    bending = np.block([[length**3 / 3.0 * across, turned @ across], [-turned @ across, turn_by_moment * length * across]])
    return bending, length * lengthwise


def _flexibilities(taper: float) -> tuple[float, float]:
    """b and c of a link whose diameter falls by a share, over 3 a."""
    places = 0.5 * (1.0 + _NODES)
    softer = _WEIGHTS / (1.0 - taper * places) ** 3
    a, b, c = (float(softer @ (1.0 - places) ** power) for power in (2, 1, 0))
    return b / (3.0 * a), c / (3.0 * a)
