"""Loads turned round, or in another unit than newtons and newton metres, where poses are measured under several.

A load has no size that is absurd in itself: what the loads did to the robot stands beside what the written loads should have
done by its nominal compliances. All joints give way by the same factor more, or less; one between a third and three is nobody's
unit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g, pound_force

from elastocal.campaigns.campaign import groups_of
from elastocal.data_checks.placement import placed, rms, robust_sigma, robustly_placed, spread
from elastocal.data_checks.protocol import Fault, Value
from elastocal.fitting.normal_equations import solve_normal
from elastocal.fitting.observations import state_clusters
from elastocal.mechanics.elastostatics import generalized_forces, regressor
from elastocal.mechanics.kinematics import jacobians, position_jacobians

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign

_MANY_POSES, _FEWEST_POSES = 150, 4
# Compliances of a robot and those of its data sheet differ by no more, all together and each beside the others.
_RATIO = 1.7
# A joint says something if its compliance is known so well, and so many joints must.
_WELL_KNOWN, _FEWEST_JOINTS = 0.15, 3
# Share of the deflections that loads as written must leave, and share of that which corrected loads may leave.
_UNEXPLAINED = 0.5
# Units that explain the deflections as well as each other, but for so much, are distinguished by the compliances alone.
_AS_WELL = 1.1
_ROUNDING_M = 1e-9
_APART, _REJECTIONS = 6.0, 4
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


@dataclass(frozen=True)
class Deflections:
    """Deflections, and what each joint should have made of them; rows are the coordinates of the measurements.

    `seen` (R,): m. `by_force`, `by_moment` (R, n): part of each joint at its nominal compliance, m. `poses`: behind the rows.
    """

    seen: np.ndarray
    by_force: np.ndarray
    by_moment: np.ndarray
    poses: int


def deflections(campaign: Campaign) -> Deflections | None:
    """Differences between the loads of each pose.

    Frames, targets and geometry are taken off as means of each target in each pose (within transformation). Returns None where
    loads do not differ within poses, compliances are not known or poses are too few: no deflection is to be expected then.
    """
    pose = state_clusters(campaign.measurements)
    loaded = campaign.robot.compliance_known and campaign.measurements.wrench.any()
    if not loaded or pose.max() + 1 < _FEWEST_POSES:
        return None
    measurements = campaign.measurements.select(np.isin(pose, np.linspace(0, pose.max(), _MANY_POSES).round().astype(int)))
    campaign, chain = replace(campaign, measurements=measurements), campaign.robot.chain
    # Frames and targets from the lowest loads: those of a wrong unit must not enter.
    whole = placed(campaign, robustly_placed(spread(campaign)).estimate)
    residual, offsets = whole.measured[0] - whole.predicted[0], whole.estimate.target_offset
    points = [replace(chain.point(t.point), offset_m=tuple(at)) for t, at in zip(campaign.targets, offsets, strict=True)]
    jacobian = position_jacobians(chain, measurements.joint_angles, points, measurements.target)
    end = jacobians(chain, measurements.joint_angles, replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)))
    torques = [generalized_forces(end, measurements.wrench * (np.arange(6) // 3 == part)) for part in (0, 1)]
    parts = [residual[..., None], *(regressor(jacobian, each) * campaign.robot.compliance for each in torques)]
    pose = state_clusters(measurements)
    group = groups_of(np.column_stack([pose, measurements.target]))[1]
    rows = [part.reshape(len(measurements), -1) for part in parts]
    centred = [_centred(part, group) for part in rows]
    if sum((part**2).sum() for part in centred[1:]) <= _DIFFERING * sum((part**2).sum() for part in rows[1:]):
        return None
    seen, by_force, by_moment = (values.reshape(residual.size, -1) for values in centred)
    return Deflections(seen[:, 0], by_force, by_moment, int(pose.max()) + 1)


def _centred(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Values (N, .) less the mean of their group."""
    total = np.zeros((group.max() + 1, values.shape[1]))
    np.add.at(total, group, values)
    return values - (total / np.bincount(group)[:, None])[group]


def wrong_loads(deflected: Deflections | None) -> list[Fault]:
    """The sign and the unit that explain deflections far better than the loads as written; none where nothing does.

    Of units that explain them as well, the one that brings the compliances nearest to the nominal ones, beside the next one.
    """
    if deflected is None:
        return []
    as_written = (deflected.by_force + deflected.by_moment).sum(axis=1)
    found = []
    for force, moment, detail in UNITS:
        corrected = force * deflected.by_force + moment * deflected.by_moment
        fitted = _ratios(deflected, corrected)
        if fitted is None:
            continue
        ratios, kept = fitted
        sign = float(np.sign(ratios.sum()))
        if (ratios * sign <= 0).any():
            continue
        off = np.log(ratios * sign)
        if max(abs(off.mean()), np.abs(off - off.mean()).max()) > np.log(_RATIO):
            continue
        seen, written = deflected.seen[kept], as_written[kept]
        before, share_before = _left(seen, written)
        after, share_after = _left(seen, sign * corrected[kept].sum(axis=1))
        if share_before >= _UNEXPLAINED and share_after <= _UNEXPLAINED * share_before:
            slope = Value("deflection over the one expected", float(written @ seen / (written @ written)), "–")
            found.append((abs(off.mean()), (before, after), sign, (force, moment, detail), slope))
    as_well = [each for each in found if each[1][1] <= _AS_WELL * min(other[1][1] for other in found)]
    if not as_well:
        return []
    (_, evidence, sign, (force, moment, detail), slope), *others = sorted(as_well, key=lambda each: each[0])
    faults = []
    if sign < 0:
        turned = "the loads fit turned round, as if they were written as what the robot does to its surroundings"
        faults.append(Fault("wrong_sign", (), turned, (slope,), evidence))
    if detail:
        units = (
            Value("newtons for each unit of force written", force, "N"),
            Value("newton metres for each unit of moment written", moment, "N m"),
        )
        less_likely = tuple(other[3][2] for other in others[:1])
        faults.append(Fault("wrong_unit", (), detail, (*units, slope), evidence, alternatives=less_likely))
    return faults


def _left(seen: np.ndarray, expected: np.ndarray) -> tuple[float, float]:
    """What expected deflections (R,), times the best factor that robots have, leave of those seen: RMS in m, and share up to 1.

    The share is of those expected where they are the larger: the same for loads written too small and too large.
    """
    factor = np.clip(expected @ seen / (expected @ expected), 1 / _RATIO, _RATIO)
    left = rms(seen - factor * expected)
    return left, min(left / max(rms(seen), factor * rms(expected)), 1.0)


def _ratios(deflected: Deflections, expected: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Compliance over nominal of the joints that are well known, and the rows left by sigma clipping."""
    joints = expected.shape[1]
    kept = np.ones(len(deflected.seen), bool)
    for _ in range(_REJECTIONS):
        solution = np.linalg.lstsq(expected[kept], deflected.seen[kept], rcond=1e-10)[0]
        residual = deflected.seen - expected @ solution
        kept = np.abs(residual) <= _APART * max(robust_sigma(np.abs(residual), 1), _ROUNDING_M)
        if kept.sum() < 4 * joints:
            return None
    level = max(rms(residual[kept]), _ROUNDING_M)
    left, right = expected[kept] / level, deflected.seen[kept] / level
    step, covariance, held = solve_normal(left.T @ left, left.T @ right, np.ones(joints))
    # Measurements of one pose have their errors in common: poses count, not measurements.
    deviation = np.sqrt(np.diag(covariance) * max(kept.sum() / (3 * deflected.poses), 1.0))
    well = ~held & (deviation < _WELL_KNOWN * np.abs(step))
    return (step[well], kept) if well.sum() >= min(_FEWEST_JOINTS, joints) else None
