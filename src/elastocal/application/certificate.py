"""What a certificate states of a robot: repeatability, errors over the workspace, what each effect costs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import stdtrit

from elastocal.application.accuracy import before_m, predict_errors
from elastocal.application.calibrated import (
    OperatingConditions,
    beyond_fitted,
    forward,
    nominal_forward,
    pose_sensitivities,
    regression_acts,
    square_root,
    without,
)
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.campaigns.groups import groups_of
from elastocal.mechanics.pose_differences import pose_differences

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.campaigns.campaign import Measurements, Target

_SPRINGS = "joint_compliance"
TOTAL, UNCERTAINTY, REPEATABILITY = "uncorrected", "uncertainty of the parameters", "repeatability"
FORM, NOT_COMMANDED = "form of the model", "not commanded"
REGRESSION, LEFT_BY_REGRESSION = "regression", "left by the regression"
# Ends of 95 % intervals.
_ENDS = (0.025, 0.975)
# ISO 9283 takes three standard deviations beyond the mean, and asks (section 7.2.1) for so many poses, approached so often.
_DEVIATIONS, ISO_POSES, ISO_CYCLES = 3.0, 5, 30
# Mean and standard deviation of the length of a vector of three standard normal components, which is of Maxwell's distribution.
_MEAN, _STD = float(np.sqrt(8.0 / np.pi)), float(np.sqrt(3.0 - 8.0 / np.pi))


@dataclass(frozen=True)
class Repeatability:
    """Pose repeatability RP, pooled over the poses that were approached again.

    `position_interval_m`: 95 % interval over poses. `orientation_rad`: the same of angles; None where positions are measured.
    `approaches`, `poses`: approaches and poses behind it.
    """

    position_m: float
    position_interval_m: tuple[float, float]
    orientation_rad: float | None
    approaches: int
    poses: int


def repeatability(measurements: Measurements, targets: Sequence[Target], point: str) -> Repeatability | None:
    """Repeatability of the end effector.

    ISO 9283:1998, section 7.2.2 [1]: mean distance of the attained positions from their barycentre plus three standard
    deviations of these distances; here pooled over poses of few repeats, whose distances count by sqrt(k / (k - 1)) for the
    degree of freedom that the barycentre takes. The interval is by the jackknife over poses on the logarithm. What the sensor
    scatters is in it.

    `point`: measuring point of the end effector; all targets count where none sits on it. Returns None without two poses that
    were approached again.

    [1] ISO 9283:1998, Manipulating industrial robots - Performance criteria and related test methods.
    """
    there = np.array([target.point == point for target in targets])[measurements.target]
    some = measurements.select(there) if there.any() else measurements
    key = np.column_stack([some.session, some.pose, some.load, some.target])
    group = groups_of(key if some.approach is None else np.column_stack([key, some.approach]))[1]
    repeated = np.bincount(group)[group] > 1
    some, group = some.select(repeated), np.unique(group[repeated], return_inverse=True)[1]
    pose = groups_of(np.column_stack([some.session, some.pose]))[1]
    if pose.max(initial=0) < 1:
        return None

    def distances(values: np.ndarray) -> np.ndarray:
        count = np.bincount(group)[group]
        mean = np.stack([np.bincount(group, column)[group] for column in values.T], axis=1) / count[:, None]
        return np.sqrt(count / (count - 1.0)) * np.linalg.norm(values - mean, axis=1)

    value, interval = _pool(distances(some.position), pose)
    angle = None
    if some.rotation_vector is not None:
        turns = Rotation.from_rotvec(some.rotation_vector)
        first = np.unique(group, return_index=True)[1][group]
        angle = _pool(distances((turns * turns[first].inv()).as_rotvec()), pose)[0]
    approaches = len(np.unique(np.column_stack([some.session, some.pose, some.load, some.repeat]), axis=0))
    return Repeatability(value, interval, angle, approaches, int(pose.max()) + 1)


def of_sensor(position_m: float) -> float:
    """Repeatability that a sensor's noise alone shows, m, by its standard deviation in one coordinate."""
    return (_MEAN + _DEVIATIONS * _STD) * position_m


def _pool(distance: np.ndarray, pose: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Mean plus three standard deviations, and its interval by leaving out one pose after the other."""
    count = np.bincount(pose).astype(float)
    sums, squares = np.bincount(pose, distance), np.bincount(pose, distance**2)
    total, many = sums.sum(), count.sum()

    def figure(sums: np.ndarray, squares: np.ndarray, many: np.ndarray) -> np.ndarray:
        mean = sums / many
        return mean + _DEVIATIONS * np.sqrt(((squares - many * mean**2) / (many - 1.0)).clip(min=0.0))

    value = float(figure(total, squares.sum(), many))
    left, poses = np.log(figure(total - sums, squares.sum() - squares, many - count)), len(count)
    error = np.sqrt((poses - 1.0) / poses * ((left - left.mean()) ** 2).sum())
    reach = stdtrit(poses - 1, _ENDS[1]) * error
    return value, (float(value * np.exp(-reach)), float(value * np.exp(reach)))


@dataclass(frozen=True)
class WorkspaceErrors:
    """Errors at poses drawn over the workspace.

    `joint_angles` (N, n): as the controller reports them, rad. `position` (N, 3): m, base axes. `uncorrected_m` (N,): as
    `accuracy.before_m`. `corrected_m`, `bound_m` (N,): of the corrected robot, as `accuracy.Prediction`. `outside` (N,): beyond
    the range of the fitted poses. `regressed` (N,): whether a regression on the remainder is added.
    """

    joint_angles: np.ndarray
    position: np.ndarray
    uncorrected_m: np.ndarray
    corrected_m: np.ndarray
    bound_m: np.ndarray
    outside: np.ndarray
    regressed: np.ndarray


def draw_angles(calibrated: CalibratedRobot, count: int, stream: np.random.Generator) -> np.ndarray:
    """Joint angles evenly over the limits, as the controller reports them, rad, ndarray (N, n)."""
    low, high = calibrated.robot.joint_limits.T
    return calibrated.robot.reported_angles(stream.uniform(low, high, (count, len(low))))


def workspace_errors(calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray) -> WorkspaceErrors:
    """Errors at some poses (N, n), rad, under one load (6,): N, N m, at the last measuring point, base axes."""
    operating = OperatingConditions(np.asarray(wrench, float)[None])
    position, rotation = forward(calibrated, reported_angles, operating)
    off = pose_differences(*nominal_forward(calibrated.robot, reported_angles), position, rotation)
    before, after = before_m(calibrated, position, rotation, off), predict_errors(calibrated, reported_angles, operating, 0)
    outside = beyond_fitted(calibrated, reported_angles)[0]
    acts = regression_acts(calibrated, reported_angles, operating)
    return WorkspaceErrors(reported_angles, position, before, after.error_m, after.bound_m, outside, acts)


@dataclass(frozen=True)
class Share:
    """A line of the budget.

    `name`: an effect by its name in the catalogue, ``joint_compliance``, or one of the constants above: `TOTAL` to
    `LEFT_BY_REGRESSION`. `low_m`, `high_m`: 95 % interval by the covariance of the parameters; None where the line has none.
    """

    name: str
    rms_m: float
    low_m: float | None = None
    high_m: float | None = None


def error_budget(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    operating: OperatingConditions,
    draws: int,
    stream: np.random.Generator,
) -> list[Share]:
    """Error budget of a robot over some states.

    Lines do not add up: effects may work against each other, and loads meet springs.

    `reported_angles` (N, n): rad, as the controller reports them. `draws`: of the parameters, for the intervals. Returns what
    is missed without any correction; each effect, largest first; what a correction leaves, by `accuracy.predict_errors`.
    """
    model, estimate = calibrated.model, calibrated.estimate
    pose = forward(calibrated, reported_angles, operating)
    # Mean products of the sensitivities of positions, and of each parameter the number of its effect; shapes, which do not
    # contribute in proportion, count in none.
    fields = subtract_placement(calibrated.scope, *pose, pose_sensitivities(calibrated, reported_angles, operating))[:, :3]
    rows = fields.reshape(-1, fields.shape[2])
    gram, numbers = rows.T @ rows / len(reported_angles), range(len(model.effects))
    sizes = zip(numbers, estimate.coefficients, estimate.shapes, strict=True)
    owners = np.concatenate([[], *(np.r_[np.full(len(a), n), np.full(len(b), -1)] for n, a, b in sizes)])
    values = np.concatenate([[], *(np.r_[a, b] for a, b in zip(estimate.coefficients, estimate.shapes, strict=True))])
    shares = []
    for name, rms in effect_costs(calibrated, reported_angles, operating).items():
        mine = np.flatnonzero(np.isin(owners, [n for n in numbers if model.effects[n].effect == name]))
        if len(mine) and rms > 0.0:
            # Ends of the linear contribution, on the scale of the exact one.
            part, known = np.ix_(mine, mine), values[mine]
            drawn = known + stream.standard_normal((draws, len(mine))) @ square_root(calibrated.covariance[part]).T
            contributions = np.sqrt(((drawn @ gram[part]) * drawn).sum(axis=1).clip(min=0.0))
            linear = np.sqrt(max(known @ gram[part] @ known, 0.0))
            low, high = np.quantile(contributions, _ENDS) * (rms / linear if linear > 0.0 else 1.0)
            shares.append(Share(name, rms, float(low), float(high)))
        elif rms > 0.0:
            shares.append(Share(name, rms))
    shares.sort(key=lambda share: -share.rms_m)
    off = pose_differences(*nominal_forward(calibrated.robot, reported_angles), *pose)
    rest = predict_errors(calibrated, reported_angles, operating, draws=0)
    lengths = {
        TOTAL: before_m(calibrated, *pose, off),
        UNCERTAINTY: rest.parameters_m,
        REPEATABILITY: rest.repeated_m,
        LEFT_BY_REGRESSION: rest.regression_m,
        FORM: rest.form_m,
        NOT_COMMANDED: np.full(1, rest.scope.left_out_m),
    }
    total, *ends = (Share(name, float(np.sqrt((length**2).mean()))) for name, length in lengths.items())
    return [total, *shares, *(end for end in ends if end.rms_m or end.name in (UNCERTAINTY, REPEATABILITY))]


def effect_costs(calibrated: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions) -> dict[str, float]:
    """RMS error in m over some states if one effect alone were left out of the correction, by effect; compliances come after
    effects, and a regression on the remainder last.

    In the frame of the robot's scope: what a new placement of its base takes up is no error there.

    `reported_angles` (N, n): rad, as the controller reports them.
    """
    pose, costs = forward(calibrated, reported_angles, operating), {}
    names = [effect.effect for effect in calibrated.model.effects]
    for name in dict.fromkeys([*names, _SPRINGS, *([REGRESSION] if calibrated.remainder else [])]):
        other = without(calibrated, {number for number, each in enumerate(names) if each == name})
        if name == REGRESSION:
            other = replace(calibrated, remainder=None)
        elif name not in names:
            # Compliances as declared are no effect of the model.
            other = replace(other, model=replace(other.model, nominal_compliance=0.0 * other.model.nominal_compliance))
        apart = pose_differences(*pose, *forward(other, reported_angles, operating))[..., None]
        costs[name] = root_mean_square(subtract_placement(calibrated.scope, *pose, apart)[:, :3, 0])
    return costs
