"""What each effect costs: by how much a robot would miss its poses if that one alone were left out of the correction."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.accuracy import before_m, predict_errors, root_mean_square, scope_in, subtract_placement
from elastocal.application.calibrated import forward, nominal_forward, observations_of, square_root, states_of
from elastocal.fitting.displacement import conditions
from elastocal.fitting.linearization import linearize
from elastocal.mechanics.pose_differences import pose_differences

if TYPE_CHECKING:
    from elastocal.application.calibrated import CalibratedRobot, OperatingConditions

SPRINGS = "joint_compliance"
_ENDS = (0.025, 0.975)


@dataclass(frozen=True)
class Share:
    """A line of the budget.

    `name`: an effect by its name in the catalogue, ``joint_compliance``, or `TOTAL`, `UNCERTAINTY`, `REPEATABILITY`, `FORM` or
    `NOT_COMMANDED`. `low_m`, `high_m`: 95 % interval by the covariance of the parameters; None where the line has none.
    """

    name: str
    rms_m: float
    low_m: float | None = None
    high_m: float | None = None


TOTAL, UNCERTAINTY, REPEATABILITY = "uncorrected", "uncertainty of the parameters", "repeatability"
FORM, NOT_COMMANDED = "form of the model", "not commanded"


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
    whole, turned = forward(calibrated, reported_angles, operating)
    gram, owners = _gram(calibrated, reported_angles, operating, (whole, turned))
    values = np.concatenate([np.zeros(0), *estimate.coefficients])
    shares = []
    for name, rms in effect_costs(calibrated, reported_angles, operating).items():
        mine = [number for number, effect in enumerate(model.effects) if effect.effect == name]
        limits: tuple[float | None, float | None] = (None, None)
        chosen = np.flatnonzero(np.isin(owners, mine))
        if mine and rms > 0.0:
            places = _linear(calibrated)[chosen]
            covariance = calibrated.covariance[np.ix_(places, places)]
            limits = _limits(gram[np.ix_(chosen, chosen)], values[chosen], covariance, rms, draws, stream)
        if rms > 0.0:
            shares.append(Share(name, rms, *limits))
    shares.sort(key=lambda share: -share.rms_m)
    off = pose_differences(*nominal_forward(calibrated.robot, reported_angles), whole, turned)
    rest = predict_errors(calibrated, reported_angles, operating, draws=0)
    total, *ends = (
        Share(name, float(np.sqrt((length**2).mean())))
        for name, length in (
            (TOTAL, before_m(calibrated, whole, turned, off)),
            (UNCERTAINTY, rest.parameters_m),
            (REPEATABILITY, rest.repeated_m),
            (FORM, np.full(1, rest.scope.form_m)),
            (NOT_COMMANDED, np.full(1, rest.scope.left_out_m)),
        )
    )
    return [total, *shares, *(end for end in ends if end.rms_m or end.name not in (FORM, NOT_COMMANDED))]


def effect_costs(calibrated: CalibratedRobot, reported_angles: np.ndarray, operating: OperatingConditions) -> dict[str, float]:
    """RMS error in m over some states if one effect alone were left out of the correction, by effect; compliances last.

    In the frame of the robot's scope: what a new placement of its base takes up is no error there.

    `reported_angles` (N, n): rad, as the controller reports them.
    """
    whole, turned = forward(calibrated, reported_angles, operating)
    costs = {}
    for name in dict.fromkeys([*(effect.effect for effect in calibrated.model.effects), SPRINGS]):
        mine = [number for number, effect in enumerate(calibrated.model.effects) if effect.effect == name]
        other = forward(_leave_out(calibrated, name, mine), reported_angles, operating)
        apart = pose_differences(whole, turned, *other)[..., None]
        costs[name] = root_mean_square(subtract_placement(scope_in(calibrated), whole, turned, apart)[:, :3, 0])
    return costs


def _leave_out(calibrated: CalibratedRobot, name: str, mine: list[int]) -> CalibratedRobot:
    values = tuple(0.0 * v if number in mine else v for number, v in enumerate(calibrated.estimate.coefficients))
    model = calibrated.model
    if name == SPRINGS and not mine:
        # Compliances as declared are no effect of the model.
        model = replace(model, nominal_compliance=0.0 * model.nominal_compliance)
    return replace(calibrated, model=model, estimate=replace(calibrated.estimate, coefficients=values))


def _gram(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    operating: OperatingConditions,
    poses: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Mean products of the linear parameters' sensitivities of positions (K, K), and the number of the effect of each (K,)."""
    model, estimate = calibrated.model, calibrated.estimate
    seen = observations_of(states_of(calibrated, reported_angles, operating))
    line = linearize(model, estimate, seen, conditions(model, estimate, seen.states))
    columns = subtract_placement(scope_in(calibrated), *poses, line.sensitivities[..., _linear(calibrated)])[:, :3]
    rows = columns.reshape(-1, columns.shape[-1])
    owners = np.repeat(np.arange(len(model.effects)), [len(values) for values in estimate.coefficients])
    return rows.T @ rows / len(reported_angles), owners


def _linear(calibrated: CalibratedRobot) -> np.ndarray:
    """Places of the linear parameters among all: shapes come behind those of their effect."""
    estimate = calibrated.estimate
    kinds = [
        np.repeat([True, False], [len(linear), len(shape)])
        for linear, shape in zip(estimate.coefficients, estimate.shapes, strict=True)
    ]
    return np.flatnonzero(np.concatenate([np.zeros(0, bool), *kinds]))


def _limits(
    gram: np.ndarray, values: np.ndarray, covariance: np.ndarray, rms: float, draws: int, stream: np.random.Generator
) -> tuple[float, float]:
    """Ends of the interval: those of the linear contribution, on the scale of the exact one."""
    drawn = values + stream.standard_normal((draws, len(values))) @ square_root(covariance).T
    contributions = np.sqrt(((drawn @ gram) * drawn).sum(axis=1).clip(min=0.0))
    linear = np.sqrt(max(values @ gram @ values, 0.0))
    low, high = np.quantile(contributions, _ENDS) * (rms / linear if linear > 0.0 else 1.0)
    return float(low), float(high)
