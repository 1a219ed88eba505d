"""The error budget of a certificate: what each effect costs, and what a correction leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import before_m, predict_errors
from elastocal.application.calibrated import (
    forward,
    nominal_forward,
    pose_sensitivities,
    square_root,
    without,
)
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.mechanics.kinematics import pose_differences

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions

_SPRINGS = "joint_compliance"
TOTAL, UNCERTAINTY, REPEATABILITY = "uncorrected", "uncertainty of the parameters", "repeatability"
FORM, NOT_COMMANDED = "form of the model", "not commanded"
REGRESSION, LEFT_BY_REGRESSION = "regression", "left by the regression"
# Ends of 95 % intervals.
_ENDS = (0.025, 0.975)


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
