"""Units of the arm in which effects are sized, see docs/method.md.

A size is what such an effect reaches; most are a tenth of it. What yields is sized by
the compliance of its own joint, what is cut by the length of the arm, loads by the
rated one: a light arm yields a hundred times as much as a heavy one, and no size in
micrometres or microradians suits both. An instrument and the place where it stands have
sizes of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g as standard_gravity

from elastocal.mechanics.robot import estimate_typical_payload_kg

if TYPE_CHECKING:
    from collections.abc import Callable

    from elastocal.mechanics.sites import Sites

ABSOLUTE = "itself"
REACH = "reach"
STIFFEST = "stiffest joint's compliance"
JOINT = "joint's compliance"
PER_LENGTH = "joint's compliance over 1 m"
SHIFT = "stiffest joint's compliance times the square of the reach"
TORQUE = "joint's turn under its full torque"
RATED = "rated load"
LOAD = "weight of the rated load"
SAG = "joint's compliance times the rated load"
# A carriage that slides turns by its compliance over the square of its length.
_CARRIAGE_M = 0.3
_SHORTEST_REACH_M = 0.3
# Of a tool; and what an arm carries over what it weighs.
_LEAST_LEVER_M = 0.5
_RATED_OVER_MASS = 1 / 6


@dataclass(frozen=True)
class Size:
    """How large one quantity of an effect is on real robots.

    `share`: size in the SI unit of the parameter, or in the unit of the arm `of`.
    `sign`: that physics gives, 0 for either. `most`: times the size that a bad case
    reaches: once where makers inspect for the size; several times where it rests on a
    unit of the arm that is a guess itself, on wear, or on what people do.
    """

    quantity: str
    share: float
    reason: str
    of: str = ABSOLUTE
    sign: int = 0
    most: float = 3.0

    def on(self, sites: Sites, *joints: int) -> float:
        """Size on an arm, in the SI unit of the parameter; `joints`: from 0, by whose
        mean compliance it is sized."""
        return self.share * _UNITS[self.of](sites, joints)


def rated_kg(sites: Sites) -> float:
    """Rated payload; or what suits the mass of an arm, or its reach."""
    if sites.payload_kg is not None:
        return sites.payload_kg
    return _RATED_OVER_MASS * sum(
        mass.mass_kg for mass in sites.masses
    ) or estimate_typical_payload_kg(sites.chain)


def lever_m(sites: Sites, joint: int) -> float:
    """Length of the arm beyond a joint, counted from 0, outstretched; at least that of
    a tool."""
    return max(
        float(np.linalg.norm(sites.link_vectors_m[joint + 1 :], axis=1).sum()),
        _LEAST_LEVER_M,
    )


def full_torque_Nm(sites: Sites, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque on a joint, from 0, of the rated payload and of the weight of its links,
    each at its longest lever."""
    pull = (
        rated_kg(sites)
        * float(np.linalg.norm(sites.gravity_m_s2))
        * lever_m(sites, joint)
    )
    return pull + sites.longest_weight_torque_Nm(joint)


def _reach_m(sites: Sites) -> float:
    return max(
        float(np.linalg.norm(sites.link_vectors_m[1:], axis=1).sum()), _SHORTEST_REACH_M
    )


def _turning(sites: Sites) -> np.ndarray:
    """Compliance of each joint as one that turns, ndarray (n,), rad/(N m)."""
    return np.where(sites.prismatic, _CARRIAGE_M**-2.0, 1.0) * sites.compliance


def _of_joints(sites: Sites, joints: tuple[int, ...]) -> float:
    return float(np.exp(np.log(_turning(sites)[list(joints)]).mean()))


_UNITS: dict[str, Callable[[Sites, tuple[int, ...]], float]] = {
    ABSOLUTE: lambda sites, joints: 1.0,
    JOINT: _of_joints,
    PER_LENGTH: _of_joints,
    STIFFEST: lambda sites, joints: float(_turning(sites).min()),
    SHIFT: lambda sites, joints: float(_turning(sites).min()) * _reach_m(sites) ** 2,
    REACH: lambda sites, joints: _reach_m(sites),
    TORQUE: lambda sites, joints: (
        _of_joints(sites, joints) * full_torque_Nm(sites, joints[0])
    ),
    RATED: lambda sites, joints: rated_kg(sites),
    LOAD: lambda sites, joints: rated_kg(sites) * standard_gravity,
    SAG: lambda sites, joints: _of_joints(sites, joints) * rated_kg(sites),
}
