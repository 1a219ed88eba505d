"""Load by which the laws of gears are scaled: a pull at the end of the outstretched arm, and the weight of its links.

tau = F l + tau_w (N m), with F the weight of the rated payload (N), l the length of the arm beyond the joint, at least
that of a tool (m), and tau_w the torque of the declared masses (N m). Derived here: each force acts at its longest lever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.mechanics.usual_values import usual_payload_kg

if TYPE_CHECKING:
    from elastocal.mechanics.sites import Sites

# Of a tool; and what an arm carries over what it weighs.
_LEAST_LEVER_M, _RATED_OVER_MASS = 0.5, 1 / 6


def rated_kg(sites: Sites) -> float:
    """Rated payload; or what suits the mass of an arm, or its reach."""
    if sites.payload_kg is not None:
        return sites.payload_kg
    return _RATED_OVER_MASS * sum(mass.mass_kg for mass in sites.masses) or usual_payload_kg(sites.chain)


def lever_m(sites: Sites, joint: int) -> float:
    """Length of the arm beyond a joint, outstretched; at least that of a tool.

    `joint`: from 0.
    """
    return max(float(np.linalg.norm(sites.link_vectors_m[joint + 1 :], axis=1).sum()), _LEAST_LEVER_M)


def full_torque_Nm(sites: Sites, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque of the rated payload at the end of the outstretched arm and of the weight of its links.

    By it laws of gears are scaled.

    `joint`: from 0.
    """
    return rated_kg(sites) * float(np.linalg.norm(sites.gravity_m_s2)) * lever_m(sites, joint) + sites.longest_weight_torque_Nm(
        joint
    )
