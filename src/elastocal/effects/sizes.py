"""Units of an arm in which the sizes of effects are stated, see docs/method.md.

A size is the magnitude that an effect can reach; most effects have a tenth of it. Elastic
effects are sized by the compliance of their joint, dimensions by the length of the arm, and
loads by the rated load: a light arm yields a hundred times as much as a heavy one, so that
no size in micrometres or microradians suits both. Sizes of instruments and their stands do
not depend on the arm.
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
OVER_WIDTH = "1 m over the width of the links"
# Length of the carriage of a prismatic joint. It tilts by its compliance over the square of
# this length.
_CARRIAGE_M = 0.3
# Lower bound on the reach, for arms whose links are not long.
_SHORTEST_REACH_M = 0.3
# Width of links over the length of the arm (KUKA KR 270: 0.3 m of 2.7 m).
_WIDTH_OF_LENGTH = 0.1
# Lower bound on the lever of a load: the length of a tool.
_LEAST_LEVER_M = 0.5
# Usual ratio of the rated payload to the mass of an arm.
_RATED_OVER_MASS = 1 / 6


@dataclass(frozen=True)
class Size:
    """Size of one quantity of an effect on real robots.

    Attributes
    ----------
    quantity : name of the quantity.
    share : size in the unit `of`.
    reason : why the quantity has this size.
    of : unit of the arm; by default the SI unit of the parameter.
    sign : sign that physics gives the quantity, 0 for either.
    most : multiple of the size that a bad case reaches. It is 1 if makers inspect for the
        size, and larger if the size depends on an estimated unit of the arm, on wear, or
        on human errors.
    """

    quantity: str
    share: float
    reason: str
    of: str = ABSOLUTE
    sign: int = 0
    most: float = 3.0

    def on(self, sites: Sites, *joints: int) -> float:
        """Compute the size on an arm, in the SI unit of the parameter.

        `joints`, from 0, are those whose (geometric) mean compliance is the unit.
        """
        return self.share * _UNITS[self.of](sites, joints)


def rated_kg(sites: Sites) -> float:
    """Find the rated payload, or estimate it from the mass of the arm or from its
    reach."""
    if sites.payload_kg is not None:
        return sites.payload_kg
    mass = sum(mass.mass_kg for mass in sites.masses)
    return _RATED_OVER_MASS * mass or estimate_typical_payload_kg(sites.chain)


def lever_m(sites: Sites, joint: int) -> float:
    """Length of the outstretched arm beyond a joint, counted from 0, and at least that of
    a tool."""
    return max(_length_beyond(sites, joint), _LEAST_LEVER_M)


def link_width_m(sites: Sites) -> float:
    """Estimate the width of the links, which is also the diameter of their bearings."""
    length_m = float(np.linalg.norm(sites.link_vectors_m, axis=1).sum())
    return _WIDTH_OF_LENGTH * max(length_m, _SHORTEST_REACH_M)


def full_torque_Nm(sites: Sites, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque on a joint, from 0, by the rated payload and the links behind it, each at its
    longest lever."""
    gravity = float(np.linalg.norm(sites.gravity_m_s2))
    payload_torque = rated_kg(sites) * gravity * lever_m(sites, joint)
    return payload_torque + sites.longest_weight_torque_Nm(joint)


def _length_beyond(sites: Sites, joint: int) -> float:
    return float(np.linalg.norm(sites.link_vectors_m[joint + 1 :], axis=1).sum())


def _reach_m(sites: Sites) -> float:
    return max(_length_beyond(sites, 0), _SHORTEST_REACH_M)


def _tilt_compliance(sites: Sites) -> np.ndarray:
    """Rotational compliance of each joint or carriage, ndarray (n,), rad/(N m)."""
    return np.where(sites.prismatic, _CARRIAGE_M**-2.0, 1.0) * sites.compliance


def _mean_compliance(sites: Sites, joints: tuple[int, ...]) -> float:
    return float(np.exp(np.log(_tilt_compliance(sites)[list(joints)]).mean()))


_UNITS: dict[str, Callable[[Sites, tuple[int, ...]], float]] = {
    ABSOLUTE: lambda sites, joints: 1.0,
    JOINT: _mean_compliance,
    PER_LENGTH: _mean_compliance,
    STIFFEST: lambda sites, joints: float(_tilt_compliance(sites).min()),
    SHIFT: lambda sites, joints: (
        float(_tilt_compliance(sites).min()) * _reach_m(sites) ** 2
    ),
    REACH: lambda sites, joints: _reach_m(sites),
    TORQUE: lambda sites, joints: (
        _mean_compliance(sites, joints) * full_torque_Nm(sites, joints[0])
    ),
    RATED: lambda sites, joints: rated_kg(sites),
    LOAD: lambda sites, joints: rated_kg(sites) * standard_gravity,
    SAG: lambda sites, joints: _mean_compliance(sites, joints) * rated_kg(sites),
    OVER_WIDTH: lambda sites, joints: 1.0 / link_width_m(sites),
}
