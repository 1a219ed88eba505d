"""Loads turned round, or in another unit than newtons and newton metres, where poses are measured under several.

A load has no size that is absurd in itself: what the loads did to the robot stands beside what the written loads should have
done by its nominal compliances.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g, pound_force

from elastocal.campaigns.campaign import groups_of
from elastocal.data_checks.placement import placed, rms, robustly_placed, spread
from elastocal.data_checks.protocol import Fault, Value
from elastocal.fitting.observations import state_clusters
from elastocal.mechanics.elastostatics import generalized_forces, regressor
from elastocal.mechanics.kinematics import jacobians, position_jacobians

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign

_MANY_POSES, _FEWEST_POSES = 150, 4
# Compliances of a robot and those of its data sheet differ by no more, all together; one between a third and three times is
# nobody's unit.
_RATIO = 1.7
# Share of the deflections that loads as written must leave, and share of that which corrected loads may leave.
_UNEXPLAINED = 0.5
# Units that explain the deflections as well as each other, but for so much, are distinguished by the compliances alone.
_AS_WELL = 1.1
# Below this share of their square, loads of one pose do not differ.
_DIFFERING = 1e-6
# Newtons and newton metres for each unit in which loads may have been written, and the words for it.
UNITS = (
    (1.0, 1.0, ""),
    (g, g, "the loads look like kilogram-force: measurements fit 9.81 times the written loads"),
    (1 / g, 1 / g, "measurements fit the written loads over 9.81, as if they had been converted twice"),
    (1e3, 1e3, "the loads look like kilonewtons: measurements fit 1000 times the written loads"),
    (1e-3, 1e-3, "the loads look like millinewtons: measurements fit a thousandth of the written loads"),
    (pound_force, pound_force, "the loads look like pounds-force: measurements fit 4.45 times the written loads"),
    (1 / pound_force, 1 / pound_force, "measurements fit the written loads over 4.45, as if they had been converted twice"),
    (1.0, 1e-3, "the moments look like newton millimetres: measurements fit a thousandth of the written moments"),
    (1e3, 1.0, "the forces look like kilonewtons: measurements fit 1000 times the written forces"),
    (g, 1.0, "the forces look like kilogram-force: measurements fit 9.81 times the written forces"),
)


def deflections(campaign: Campaign) -> tuple[np.ndarray, np.ndarray] | None:
    """Differences between the loads of each pose: those seen (R,), and those expected of forces and of moments (R, 2), m.

    Rows are coordinates of measurements. Frames, targets and geometry are taken off as means of each target in each pose
    (within transformation). None where loads do not differ within poses, compliances are not known or poses are too few.
    """
    pose = state_clusters(campaign.measurements)
    loaded = campaign.robot.compliance_known and campaign.measurements.wrench.any()
    if not loaded or pose.max() + 1 < _FEWEST_POSES:
        return None
    measurements = campaign.measurements.select(np.isin(pose, np.linspace(0, pose.max(), _MANY_POSES).round().astype(int)))
    campaign, chain = replace(campaign, measurements=measurements), campaign.robot.chain
    # Frames and targets from the lowest loads: those of a wrong unit must not enter.
    whole = placed(campaign, robustly_placed(spread(campaign)).estimate)
    targets = zip(campaign.targets, whole.estimate.target_offset, strict=True)
    points = [replace(chain.point(target.point), offset_m=tuple(at)) for target, at in targets]
    jacobian = position_jacobians(chain, measurements.joint_angles, points, measurements.target)
    end = jacobians(chain, measurements.joint_angles, replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)))
    torques = [generalized_forces(end, measurements.wrench * (np.arange(6) // 3 == part)) for part in (0, 1)]
    expected = [regressor(jacobian, each) @ campaign.robot.compliance for each in torques]
    group = groups_of(np.column_stack([state_clusters(measurements), measurements.target]))[1]
    rows = np.stack([whole.measured[0] - whole.predicted[0], *expected], axis=-1)
    mean = np.zeros((group.max() + 1, *rows.shape[1:]))
    np.add.at(mean, group, rows)
    off = rows - (mean / np.bincount(group)[:, None, None])[group]
    if (off[..., 1:] ** 2).sum() <= _DIFFERING * (rows[..., 1:] ** 2).sum():
        return None
    return off[..., 0].ravel(), off[..., 1:].reshape(-1, 2)


def wrong_loads(seen: np.ndarray, expected: np.ndarray) -> list[Fault]:
    """The sign and the unit that explain deflections, see `deflections`, far better than the loads as written, if any do.

    Of units that explain them as well, the one that brings the compliances nearest to the nominal ones, beside the next one.
    """
    as_written = expected.sum(axis=1)
    before, share, _ = _left(seen, as_written)
    found = []
    for force, moment, detail in UNITS:
        corrected = expected @ (force, moment)
        sign = float(np.sign(corrected @ seen))
        after, share_after, off = _left(seen, sign * corrected)
        if share >= _UNEXPLAINED and share_after <= _UNEXPLAINED * share:
            found.append((off, after, sign, force, moment, detail))
    as_well = sorted(each for each in found if each[1] <= _AS_WELL * min(other[1] for other in found))
    if not as_well:
        return []
    (_, after, sign, force, moment, detail), *others = as_well
    slope, faults = Value("deflection over the one expected", float(as_written @ seen / (as_written @ as_written)), "–"), []
    if sign < 0:
        turned = "the loads fit turned round, as if they were written as what the robot does to its surroundings"
        faults.append(Fault("wrong_sign", (), turned, (slope,), (before, after)))
    if detail:
        units = (
            Value("newtons for each unit of force written", force, "N"),
            Value("newton metres for each unit of moment written", moment, "N m"),
        )
        less_likely = tuple(other[-1] for other in others[:1])
        faults.append(Fault("wrong_unit", (), detail, (*units, slope), (before, after), alternatives=less_likely))
    return faults


def _left(seen: np.ndarray, expected: np.ndarray) -> tuple[float, float, float]:
    """What expected deflections (R,), times the best factor that robots have, leave of those seen: RMS in m, and share up to 1.

    The share is of those expected where they are the larger: the same for loads written too small and too large. The last is
    how far that factor is from 1, of its logarithm.
    """
    factor = np.clip(expected @ seen / (expected @ expected), 1 / _RATIO, _RATIO)
    left = rms(seen - factor * expected)
    return left, min(left / max(rms(seen), factor * rms(expected)), 1.0), float(abs(np.log(factor)))
