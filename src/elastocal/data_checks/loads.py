"""Loads turned round, or in another unit than newtons and newton metres.

A load has no size that is absurd in itself: what the loads did to the robot stands beside what the written loads should have
done by its nominal compliances. All joints give way by the same factor more, or less; one between a third and three is nobody's
unit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.constants import g, pound_force

from elastocal.data_checks.placement import at_targets, free_columns, rms, robust_sigma, robustly_placed, spread
from elastocal.data_checks.protocol import Fault, Value
from elastocal.fitting.model import measured_in_base
from elastocal.fitting.normal_equations import solve_normal
from elastocal.fitting.observations import single_observations, state_clusters
from elastocal.mechanics.elastostatics import generalized_forces, regressor
from elastocal.mechanics.kinematics import poses_and_jacobians

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements

NAMES, FAMILY, AFTER = ("wrong_sign", "wrong_unit"), "data", ("constant_columns", "alternatives")

_MANY_POSES = 150
# Compliances of a robot and those of its data sheet differ by no more, all together and each beside the others.
_RATIO = 1.7
# A joint says something if its compliance is known so well, and so many joints must.
_WELL_KNOWN, _FEWEST_JOINTS = 0.15, 3
# Share of the deflections that loads as written must leave, and share of that which corrected loads may leave.
_UNEXPLAINED = 0.5
# Units that explain the deflections as well as each other, but for so much, are distinguished by the compliances alone.
_AS_WELL = 1.1
_FEWEST_POSES = 4
_ROUNDING_M = 1e-9
_APART, _REJECTIONS = 6.0, 4
# Below this share of their square, loads of one pose do not differ.
_DIFFERING = 1e-6


@dataclass(frozen=True)
class Unit:
    """Units in which loads may have been written.

    `force`, `moment`: N and N m for each unit written. `detail`: empty for N and N m themselves.
    """

    force: float
    moment: float
    detail: str


UNITS = (
    Unit(1.0, 1.0, ""),
    Unit(g, g, "the loads look like kilogram-force: measurements fit 9.81 times the written loads"),
    Unit(1 / g, 1 / g, "measurements fit the written loads over 9.81, as if they had been converted twice"),
    Unit(1e3, 1e3, "the loads look like kilonewtons: measurements fit 1000 times the written loads"),
    Unit(1e-3, 1e-3, "the loads look like millinewtons: measurements fit a thousandth of the written loads"),
    Unit(pound_force, pound_force, "the loads look like pounds-force: measurements fit 4.45 times the written loads"),
    Unit(1 / pound_force, 1 / pound_force, "measurements fit the written loads over 4.45, as if they had been converted twice"),
    Unit(1.0, 1e-3, "the moments look like newton millimetres: measurements fit a thousandth of the written moments"),
    Unit(1e3, 1.0, "the forces look like kilonewtons: measurements fit 1000 times the written forces"),
    Unit(g, 1.0, "the forces look like kilogram-force: measurements fit 9.81 times the written forces"),
)


def find(campaign: Campaign, measurements: Measurements) -> list[Fault]:
    """Sign and unit in which the loads explain the measurements, where they are not as they must be.

    Only where compliances are known: no size of a deflection is to be expected else.
    """
    deflected = deflections(campaign, measurements) if campaign.robot.compliance_known else None
    found = unit_of_loads(deflected) if deflected else None
    if found is None:
        return []
    evidence, faults = (found.rms_as_written, found.rms_corrected), []
    slope = Value("deflection over the one expected", found.slope, "–")
    if found.sign < 0:
        detail = "the loads fit turned round, as if they were written as what the robot does to its surroundings"
        faults.append(Fault("wrong_sign", (), detail, (slope,), evidence, (), True))
    if found.unit.detail:
        parameters = (
            Value("newtons for each unit of force written", found.unit.force, "N"),
            Value("newton metres for each unit of moment written", found.unit.moment, "N m"),
            slope,
        )
        other = found.less_likely
        detail = found.unit.detail if other is None else f"{found.unit.detail}; less likely, {other.detail}"
        faults.append(Fault("wrong_unit", (), detail, parameters, evidence, (), True))
    return faults


@dataclass(frozen=True)
class Deflections:
    """Deflections, and what each joint should have made of them; rows are the coordinates of the measurements.

    `seen` (R,): m. `by_force`, `by_moment` (R, n): part of each joint at its nominal compliance, m. `poses`: behind the rows.
    """

    seen: np.ndarray
    by_force: np.ndarray
    by_moment: np.ndarray
    poses: int


@dataclass(frozen=True)
class UnitFound:
    """Sign and unit in which the loads explain the deflections.

    `sign`: +1, or -1 where the loads are turned round. `unit`: which brings the compliances nearest to the nominal ones.
    `less_likely`: another that explains the deflections as well, by compliances that are further from the nominal ones.
    `slope`: deflection seen over the one expected as written, the mean over the joints. `rms_as_written`, `rms_corrected`:
    residual at nominal compliances times the best factor that robots have in common, m.
    """

    sign: float
    unit: Unit
    less_likely: Unit | None
    slope: float
    rms_as_written: float
    rms_corrected: float


def deflections(campaign: Campaign, measurements: Measurements) -> Deflections | None:
    """Differences between the loads of each pose; where there is one load a pose, all of the deflection.

    Frames, targets and geometry are taken off as means of each target in each pose (within transformation) or, where the loads
    of a pose do not differ, by projection (Frisch-Waugh-Lovell theorem [1]).

    Returns None without loads, or with too few poses.

    [1] Lovell, M. C., Seasonal adjustment of economic time series and multiple regression analysis, Journal of the American
        Statistical Association 58, 1963.
    """
    if not measurements.wrench.any():
        return None
    pose = state_clusters(measurements)
    chosen = np.unique(np.linspace(0, pose.max(), _MANY_POSES).round().astype(int))
    measurements = measurements.select(np.isin(pose, chosen))
    # Frames and targets from the lowest loads: those of a wrong unit must not enter.
    estimate = robustly_placed(campaign, spread(measurements)).estimate
    position, rotation, jacobian = at_targets(campaign.robot.chain, measurements.joint_angles, campaign, measurements, estimate)
    residual, end = measured_in_base(estimate, single_observations(measurements))[0] - position, _end(campaign, measurements)
    torques = [generalized_forces(end, measurements.wrench * (np.arange(6) // 3 == part)) for part in (0, 1)]
    parts = [regressor(jacobian, each) * campaign.robot.compliance for each in torques]
    pose = state_clusters(measurements)
    count = int(pose.max()) + 1
    if count < _FEWEST_POSES:
        return None
    group = pose * len(campaign.targets) + measurements.target
    centred = [_centred(values, group) for values in (residual[..., None], *parts)]
    whole = sum((part**2).sum() for part in parts)
    if sum((part**2).sum() for part in centred[1:]) <= _DIFFERING * whole:
        # Less what frames, targets and joint offsets can explain of them.
        columns = [jacobian, *free_columns(campaign, measurements, rotation, position)]
        left, sizes, _ = np.linalg.svd(np.concatenate(columns, axis=-1).reshape(residual.size, -1), full_matrices=False)
        basis = left[:, sizes > 1e-9 * sizes[0]]
        whole_columns = [part.reshape(residual.size, -1) for part in (residual, *parts)]
        centred = [values - basis @ (basis.T @ values) for values in whole_columns]
    flat = [values.reshape(3 * len(measurements), -1) for values in centred]
    return Deflections(flat[0][:, 0], flat[1], flat[2], count)


def unit_of_loads(deflected: Deflections) -> UnitFound | None:
    """The sign and unit that explain the deflections far better than the loads as written.

    Returns None where the loads as written do, or where nothing does.
    """
    as_written = (deflected.by_force + deflected.by_moment).sum(axis=1)
    found = []
    for unit in UNITS:
        corrected = unit.force * deflected.by_force + unit.moment * deflected.by_moment
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
            slope = float(written @ seen / (written @ written))
            found.append((abs(off.mean()), UnitFound(sign, unit, None, slope, before, after)))
    if not found:
        return None
    least = min(each.rms_corrected for _, each in found)
    as_well = sorted((pair for pair in found if pair[1].rms_corrected <= _AS_WELL * least), key=lambda pair: pair[0])
    best = as_well[0][1]
    return replace(best, less_likely=as_well[1][1].unit) if len(as_well) > 1 else best


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
        left, right = expected[kept], deflected.seen[kept]
        solution = np.linalg.lstsq(left, right, rcond=1e-10)[0]
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
    if well.sum() < min(_FEWEST_JOINTS, joints):
        return None
    return step[well], kept


def _end(campaign: Campaign, measurements: Measurements) -> np.ndarray:
    """Jacobian of the origin of the last measuring point, where wrenches are stated, ndarray (N, 6, n)."""
    chain = campaign.robot.chain
    return poses_and_jacobians(chain, measurements.joint_angles, replace(chain.end_effector, offset_m=(0.0, 0.0, 0.0)))[2]


def _centred(values: np.ndarray, group: np.ndarray) -> np.ndarray:
    """Values less the mean of their group."""
    total = np.zeros((group.max() + 1, *values.shape[1:]))
    np.add.at(total, group, values)
    return values - (total / np.maximum(np.bincount(group), 1).reshape(-1, *[1] * (values.ndim - 1)))[group]
