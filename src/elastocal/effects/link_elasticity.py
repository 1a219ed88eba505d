"""A link that bends and twists: a cantilever between two joints.

Catalogue row 5, Euler-Bernoulli and St Venant: with the wrench at the far end in a frame with x along the link,
y = F_y l^3/3EI + M_z l^2/2EI, r_z = F_y l^2/2EI + M_z l/EI, likewise in the other plane, r_x = M_x l/GJ. Linear in 1/EI
and 1/GJ. Stretching is some hundred times less than bending and left out.
"""

import numpy as np

from elastocal.effects.protocol import Candidate, Parameter

NAME, FAMILY = "link_elasticity", "elastic"
WORDS = "elastic bending and torsion"
PART = "link"
DETAIL_WORDS = {"one section": "all of one cross-section"}
# One per mille of the bending compliance of a solid steel rod of 0.1 m is 1e-9; thin-walled cast arms reach 1e-6.
_PARAMETERS = tuple(Parameter(name, "1/(N m^2)", 3e-7, sign=1) for name in ("bending_1_over_EI", "torsion_1_over_GJ"))
_SHORTEST_M = 0.05


def candidates(sites):
    """One candidate a link with a length, named by the joint before it; the column; and all links with one section.

    One section is what a robot of like tubes has: two parameters for the whole arm, where a candidate a link has two each.
    """
    long = [k for k in range(sites.joints + 1) if np.linalg.norm(sites.link_vectors_m[k]) > _SHORTEST_M]
    each = [_candidate(sites, (link,), "" if link else "column") for link in long]
    return [*each, _candidate(sites, tuple(long), "one section")] if len(long) > 1 else each


def _candidate(sites, links, detail):
    def displacement(circumstances):
        bent, twisted = {}, {}
        for link in links:
            bending, torsion = _deflection(sites, link, circumstances.total)
            bent |= bending
            twisted |= torsion
        return [bent, twisted]

    joints = tuple(k for k in links if k)
    return Candidate(NAME, FAMILY, joints, detail, _PARAMETERS, displacement, frozenset({"load"}), place=detail)


def _deflection(sites, link, load):
    """Displacement of the far end of a link for a unit of 1/EI and of 1/GJ."""
    coordinates = sites.link_end[link]
    length = np.linalg.norm(sites.link_vectors_m[link])
    along = sites.link_vectors_m[link] / length
    force, moment = np.split(load[:, coordinates], 2, axis=1)
    across, twist = force - np.outer(force @ along, along), np.outer(moment @ along, along)
    bending = moment - twist
    shift = length**3 / 3 * across + length**2 / 2 * np.cross(bending, along)
    turn = length**2 / 2 * np.cross(along, across) + length * bending
    return (
        dict(zip(coordinates, np.concatenate([shift, turn], axis=1).T, strict=True)),
        dict(zip(coordinates[3:], (length * twist).T, strict=True)),
    )
