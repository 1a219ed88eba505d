"""Positions that stay where they are while the robot moves, or joint angles that do not move while the measurements do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.data_checks.placement import IMPLAUSIBLE_M, of_each_target, placed, spread
from elastocal.data_checks.protocol import Fault, Value

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements

NAMES, FAMILY, AFTER = ("constant_columns",), "data", ()

# Below the last digit that any sensor writes (0.1 µm) and any controller reports (1e-6 rad or so).
_SAME_M, _SAME_RAD = 1e-6, 1e-6
_FEWEST_POSES = 3


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """Columns that are the same in all poses and cannot be.

    Returns one for each kind, of the first target that shows it.
    """
    some = spread(measurements)
    predicted = placed(campaign, some).predicted
    found = []
    for members in of_each_target(some):
        poses = len(np.unique(some.pose[members]))
        if poses < _FEWEST_POSES:
            continue
        measured, angles = some.position[members], some.joint_angles[members]
        # Standard deviations along the main axes, the smallest first: a plane seen in its own axes has one constant column.
        needed = _extents(predicted[members])
        still = np.ptp(measured, axis=0) < _SAME_M
        who, kinds = campaign.targets[some.target[members[0]]].name, []
        if still.any() and needed[still.sum() - 1] > IMPLAUSIBLE_M:
            axes = ", ".join(np.array(list("xyz"))[still])
            verb = "are" if still.sum() > 1 else "is"
            where = "zero" if not measured[:, still].any() else "the same"
            detail = f"{axes} of {who} {verb} {where} in all {poses} poses, though by its joint angles the robot moved"
            kinds.append((detail, needed[-1]))
        moved = _extents(measured)[-1]
        if np.ptp(angles, axis=0).max() < _SAME_RAD and moved > IMPLAUSIBLE_M:
            same = f"the joint angles are the same in all {poses} poses"
            kinds.append((f"{same}, though the measurements of {who} lie {moved:.2g} m apart", moved))
        count = (Value("poses", float(poses), "–"),)
        found += [Fault(NAMES[0], (), detail, count, (float(size), 0.0), (), True) for detail, size in kinds]
    # One of each kind speaks for all targets.
    return list({fault.detail.split(" of ")[0]: fault for fault in reversed(found)}.values())


def _extents(points: np.ndarray) -> np.ndarray:
    """Standard deviations of points along their principal axes, rising, ndarray (3,), m."""
    off = points - points.mean(axis=0)
    return np.sqrt(np.maximum(np.linalg.eigvalsh(off.T @ off / len(points)), 0.0))
