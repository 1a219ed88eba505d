"""The error budget of a certificate: what each effect costs, and what a correction leaves."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import before_m, predict_errors
from elastocal.application.calibrated import forward, nominal_forward, without
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.mechanics.kinematics import pose_differences

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions

_SPRINGS = "joint_compliance"
TOTAL, UNCERTAINTY, REPEATABILITY = "uncorrected", "uncertainty of the parameters", "repeatability"
FORM, NOT_COMMANDED = "form of the model", "not commanded"
REGRESSION, LEFT_BY_REGRESSION = "regression", "left by the regression"


def error_budget(calibrated: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions) -> dict[str, float]:
    """Error budget of a robot over some states, m, RMS.

    Lines do not add up: effects may work against each other, and loads meet springs.

    `reported_angles` (N, n): rad, as the controller reports them. Returns what is missed without any correction; each effect by
    its name in the catalogue, or ``joint_compliance``, largest first; what a correction leaves, by `accuracy.predict_errors`.
    """
    pose = forward(calibrated, reported_angles, operating)
    costs = sorted(effect_costs(calibrated, reported_angles, operating).items(), key=lambda cost: -cost[1])
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
    ends = {name: float(np.sqrt((length**2).mean())) for name, length in lengths.items()}
    total, always = ends.pop(TOTAL), (UNCERTAINTY, REPEATABILITY)
    return {
        TOTAL: total,
        **{name: cost for name, cost in costs if cost > 0.0},
        **{name: end for name, end in ends.items() if end or name in always},
    }


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
