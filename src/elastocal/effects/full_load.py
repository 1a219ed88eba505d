"""Load by which the laws of gears are scaled: a pull at the end of the outstretched arm, and the weight of its links.

tau = F l + tau_w (N m), with F the weight of the rated payload, or 1 kN (N), l the length of the arm beyond the joint, at least
that of a tool (m), and tau_w the torque of the declared masses (N m). Derived here: each force acts at its longest lever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from elastocal.mechanics.sites import Sites

# A pull at the end of the arm, at the least lever of a tool.
_PULL_N, _LEAST_LEVER_M = 1e3, 0.5


def lever_m(sites: Sites, joint: int) -> float:
    """Length of the arm beyond a joint, outstretched; at least that of a tool.

    `joint`: from 0.
    """
    return max(float(np.linalg.norm(sites.link_vectors_m[joint + 1 :], axis=1).sum()), _LEAST_LEVER_M)


def full_torque_Nm(sites: Sites, joint: int) -> float:  # noqa: N802 - units in names keep their case
    """Torque of the rated payload, or of a kilonewton, at the end of the outstretched arm and of the weight of its links.

    By it laws of gears are scaled.

    `joint`: from 0.
    """
    pull = _PULL_N if sites.payload_kg is None else sites.payload_kg * float(np.linalg.norm(sites.gravity_m_s2))
    return pull * lever_m(sites, joint) + sites.longest_weight_torque_Nm(joint)
