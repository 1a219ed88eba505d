"""Choose a regression on the residuals of a fitted model, and validate both on poses
that no fit has seen.

The best of many settings is the best partly by luck. Each outer fold of the training
poses is therefore predicted by a regression that the other folds choose among
themselves and fit (nested cross-validation [1]_). These predictions decide whether
anything is corrected, by one test over configurations, and how much of the correction
is kept, by a slope of at most one.

References
----------
.. [1] Varma and Simon, Bias in error estimation when using cross-validation for model
   selection, BMC Bioinformatics 7, 2006.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtr

from elastocal.campaigns.campaign import BEST_REMAINDER
from elastocal.campaigns.holdout import number_configurations, partition_poses
from elastocal.effects.catalogue import list_effects, moves_robot
from elastocal.fitting.least_squares import fit_placement
from elastocal.fitting.linearization import compute_effect_sensitivities
from elastocal.fitting.model import evaluate_conditions, locate_targets
from elastocal.fitting.observations import index_poses, sample_observations
from elastocal.mechanics.kinematics import compute_position_jacobians
from elastocal.residual_model.regressions import Inputs, Predictor, list_regressions
from elastocal.validation.held_out import (
    PositionErrors,
    compute_error_intervals,
    compute_position_errors,
    compute_position_residuals,
    refit_without_folds,
    summarize_errors,
)
from elastocal.validation.transfer import (
    compute_joint_range,
    find_beyond_campaign,
    is_same_campaign,
    transfer_fit,
)
from elastocal.verdict import (
    CrossValidatedGain,
    ErrorSummary,
    HalfWidths,
    RegressionChoice,
    Remainder,
    Spread,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.observations import Observations, States
    from elastocal.residual_model.regressions import Setting

CONFIDENCE = 0.95
# Half width of the interval that holds 95 % of a normal distribution, in standard
# deviations.
NORMAL_QUANTILE = 1.959964
# Level of the test that a regression must pass: how often one is chosen if the residual
# is noise. With few configurations, the fits of the outer folds differ so much from the
# final one that the test must be stricter; with even fewer, a fold of a fold leaves
# nothing to fit.
_LEVEL = 0.05
_STRICT_LEVEL = 0.01
_FEW_CONFIGURATIONS = 40
MIN_CONFIGURATIONS = 10
_FOLDS = 5
# Upper bound on the observations that choose a regression: they determine the quantile
# that scales its intervals to two per cent.
_MAX_TO_CHOOSE = 2_000
# Upper bound on the observations of the final fit: a process takes eight minutes for a
# million, and far fewer determine its 2,000 values.
_MAX_TO_FIT = 10_000
_REPLICATES = 1000
# Margin beyond a joint's fitted range within which a regression is still added, as a
# share of the range. No pose has neighbours that close, and without a margin some 3 % of
# poses drawn like 200 fitted ones would be excluded for a hundredth of the range.
_RANGE_MARGIN = 0.05
# Ridge regression shrinks the correction of an effect of plausible size like so large a
# deviation of a joint.
_RAD_PER_SIZE = 1e-3
# Conditions that no command states, named as in `effects.conditions`.
_NOT_COMMANDED = {"approach", "time", "order", "temperature"}


@dataclass(frozen=True)
class ResidualModelPlan:
    """How a regression on residuals is chosen and applied.

    Attributes
    ----------
    regression : str
        Its name; `BEST_REMAINDER` chooses the regression that predicts left-out poses
        best.
    blocks : bool
        Whether folds are blocks of joint space, for poses far from the fitted ones;
        otherwise folds are random.
    within_range : bool
        Whether nothing is corrected beyond the fitted joint angles and loads.
    seed : int
    """

    regression: str
    blocks: bool
    within_range: bool
    seed: int


@dataclass(frozen=True)
class CorrectedResiduals:
    """Residuals of a model and a regression at M observations that neither has seen.

    Attributes
    ----------
    residual : (M, 3) array, measured minus predicted positions, m, base axes
    std : (M, 3) array or None
        Stated standard deviation, m; None if nothing is corrected.
    outside : (M,) bool array, beyond the fitted joint angles or loads
    choice : RegressionChoice
    predictor : Predictor or None
        Of the residuals of the physical model; None if nothing is corrected.
    """

    residual: np.ndarray
    std: np.ndarray | None
    outside: np.ndarray
    choice: RegressionChoice
    predictor: Predictor | None


def validate_residual_model(
    fitted: Fit, case: Case, held_out: Case, plan: ResidualModelPlan
) -> CorrectedResiduals:
    """Predict held-out poses by a model and a regression on its training residuals.

    Cross-validation of the training poses, with the model refitted without each fold,
    decides whether there is a regression, its setting, size and intervals. If another
    campaign is held out, its frames and targets are fitted to the residuals of both.

    Parameters
    ----------
    fitted : Fit to the training poses
    case : Case of the training poses
    held_out : Case
    plan : ResidualModelPlan
    """
    observations = held_out.observations
    states = observations.states
    model, estimate = transfer_fit(fitted, case, held_out)
    choice = _choose_on_training(fitted, case.observations, plan)
    outside = find_beyond_regression(
        case.observations.states, states.joint_angles, states.wrench
    )[observations.state]
    mean = np.zeros((len(observations), 3))
    std = None
    predictor = None
    if choice.regression:
        predictor = fit_to_observations(
            choice, fitted.model, fitted.estimate, case.observations
        )
        inputs = build_inputs(
            model,
            estimate,
            observations,
            with_jacobian=list_regressions()[choice.regression].uses_jacobian,
        )
        excluded = outside[:, None] & plan.within_range
        mean = np.where(excluded, 0.0, predictor.mean(inputs))
        std = predictor.std(inputs)
    if not is_same_campaign(case, held_out):
        transferred = replace(fitted, model=model, estimate=estimate)
        estimate = _refit_placement(transferred, observations, mean)
    residual = compute_position_residuals(model, estimate, observations) - mean
    return CorrectedResiduals(residual, std, outside, choice, predictor)


def _refit_placement(
    fitted: Fit, observations: Observations, correction: np.ndarray
) -> Estimate:
    """Fit frames and targets to the residuals that a correction (M, 3), m, leaves."""
    session = fitted.estimate.index_sessions(observations)
    rotation = fitted.estimate.frame_rotation[session]
    position = observations.position - (rotation @ correction[..., None])[..., 0]
    return fit_placement(fitted, fitted.model, replace(observations, position=position))


def is_commanded(effect: Candidate) -> bool:
    """Whether a correction contains an effect: it moves the robot, and a command states
    the conditions on which it depends."""
    return moves_robot(effect) and effect.needs.isdisjoint(_NOT_COMMANDED)


def find_beyond_regression(
    fitted: States, joint_angles: np.ndarray, wrench: np.ndarray | None
) -> np.ndarray:
    """Find the states at which no regression is added.

    They lie beyond the fitted loads, or beyond the fitted joint angles with a margin.

    Parameters
    ----------
    fitted : States
    joint_angles : (N, n) array, angles of the chain, rad
    wrench : (N, 6) array, N and N m; None without loads

    Returns
    -------
    (N,) bool array
    """
    middle = _find_middle(fitted)
    shrunk = middle + (joint_angles - middle) / (1.0 + 2.0 * _RANGE_MARGIN)
    return find_beyond_campaign(fitted, shrunk, wrench)


def compute_regression_range(fitted: States) -> tuple[np.ndarray, np.ndarray]:
    """Compute the lowest and the highest angle (n,) of each joint at which
    `find_beyond_regression` still lets a regression be added."""
    middle = _find_middle(fitted)
    low, high = (
        middle + (1.0 + 2.0 * _RANGE_MARGIN) * (end - middle)
        for end in compute_joint_range(fitted)
    )
    return low, high


def _find_middle(fitted: States) -> np.ndarray:
    """Find the middle of the fitted range of each joint, (n,) array."""
    lowest = fitted.joint_angles.min(axis=0)
    return np.asarray(0.5 * (lowest + fitted.joint_angles.max(axis=0)))


def fit_to_observations(
    choice: RegressionChoice,
    model: Model,
    estimate: Estimate,
    observations: Observations,
) -> Predictor:
    """Fit a chosen regression to the residuals of a model at its training poses."""
    sample = sample_observations(observations, _MAX_TO_FIT)
    inputs = build_inputs(
        model,
        estimate,
        sample,
        with_jacobian=list_regressions()[choice.regression].uses_jacobian,
    )
    return fit_choice(
        choice, inputs, compute_position_residuals(model, estimate, sample)
    )


def fit_choice(
    choice: RegressionChoice, inputs: Inputs, residual: np.ndarray
) -> Predictor:
    """Fit a chosen regression to residuals (M, 3), m.

    Its predictions are shrunk, and its intervals scaled, as left-out poses require.
    """
    spread = choice.spread
    assert spread is not None, "no regression was chosen"
    assert choice.left_out is not None and choice.setting is not None
    shrinkage = choice.left_out.factor
    std_factor = np.nan if spread.times is None else spread.times
    predictor = _fit_setting(
        choice.regression, choice.setting, inputs, residual, choice.seed
    )

    def mean(queries: Inputs) -> np.ndarray:
        return shrinkage * predictor.mean(queries)

    def std(queries: Inputs) -> np.ndarray:
        stated = std_factor * predictor.std(queries)
        return np.where(np.isfinite(stated), stated, spread.otherwise_m)

    express = predictor.law
    if express is None:
        return Predictor(mean, std)
    return Predictor(mean, std, lambda: express().scaled(shrinkage))


def _fit_setting(
    name: str, setting: Setting, inputs: Inputs, residual: np.ndarray, seed: int
) -> Predictor:
    return next(list_regressions()[name].fit(inputs, residual, [setting], seed))


def build_geometric_inputs(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    *,
    with_jacobian: bool = True,
) -> Inputs:
    """Build inputs from the nominal chain and the positions of the targets.

    Parameters
    ----------
    model : Model
    estimate : Estimate, for the target offsets
    observations : Observations
    with_jacobian : bool
        Whether the regression uses the Jacobian, which otherwise has no columns.
    """
    states = observations.states
    chain = model.sites.chain
    state = observations.state
    covariates = np.hstack(
        [states.wrench[state], estimate.target_offset[observations.target]]
    )
    jacobian = np.empty((len(observations), 3, 0))
    if with_jacobian:
        jacobian = compute_position_jacobians(
            chain,
            chain.at(states.joint_angles)[state],
            locate_targets(model, estimate),
            observations.target,
        )
    return Inputs(states.joint_angles[state], covariates, jacobian)


def build_inputs(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    *,
    with_jacobian: bool = True,
) -> Inputs:
    """Build `build_geometric_inputs` and add displacements by the model's effects.

    The latter are columns of the Jacobian. An effect that was adopted wrongly absorbs a
    part of an error that no effect describes. A regression that cannot undo this part
    must describe the rest of the error and the wrong effect.
    """
    inputs = build_geometric_inputs(
        model, estimate, observations, with_jacobian=with_jacobian
    )
    effects = [
        (effect, shapes)
        for effect, shapes in zip(model.effects, estimate.shapes, strict=True)
        if _is_correctable(effect)
    ]
    if not effects or not with_jacobian:
        return inputs
    columns = compute_effect_sensitivities(
        [(effect.displacement, shapes) for effect, shapes in effects],
        evaluate_conditions(model, estimate, observations.states),
        inputs.jacobian,
        observations.state,
        compute_effect_factors(model),
    )
    return replace(inputs, jacobian=np.concatenate([inputs.jacobian, columns], axis=2))


def compute_effect_factors(model: Model) -> np.ndarray:
    """Compute the factors (D,) of the effects' columns in `build_inputs`, one for each
    parameter."""
    sizes = [
        parameter.plausible
        for effect in model.effects
        if _is_correctable(effect)
        for parameter in effect.parameters
    ]
    return np.array(sizes) / _RAD_PER_SIZE


def _is_correctable(effect: Candidate) -> bool:
    """Whether a regression may undo what was assigned to an effect."""
    return effect.effect in list_effects() and is_commanded(effect)


def summarize_residual_model(
    corrected: CorrectedResiduals,
    declared: Fit,
    final: Fit,
    case: Case,
    held_out: Case,
    stream: np.random.Generator,
) -> Remainder:
    """Summarize held-out errors with and without the regression on the residuals.

    Parameters
    ----------
    corrected : CorrectedResiduals of the held-out poses
    declared, final : fits to the training poses
    case : Case of the training poses
    held_out : Case
    stream : of the bootstrap over poses
    """
    before, after = (
        compute_position_errors(
            *transfer_fit(fitted, case, held_out), held_out.observations
        )
        for fitted in (declared, final)
    )
    with_regression = PositionErrors(
        np.linalg.norm(corrected.residual, axis=1), before.cluster
    )
    intervals, reductions = compute_error_intervals(
        [after, with_regression], _REPLICATES, stream
    )
    low, high = intervals[1]["rms_m"]
    square_before, square_after, square_with = (
        float((errors.distance**2).mean())
        for errors in (before, after, with_regression)
    )
    covered = None
    half_widths = None
    if corrected.std is not None:
        width = NORMAL_QUANTILE * corrected.std
        covered = float((np.abs(corrected.residual) < width).mean())
        half_widths = HalfWidths(
            within=_find_median(width[~corrected.outside]),
            outside=_find_median(width[corrected.outside]),
        )
    return Remainder(
        **vars(corrected.choice),
        errors=ErrorSummary(**summarize_errors(with_regression.distance)),
        rms_ci95_m=(float(low), float(high)),
        reduction_ci95=(reductions[1].low, reductions[1].high),
        physics=1.0 - square_after / square_before,
        regression_share=(square_after - square_with) / square_before,
        left=square_with / square_before,
        outside=len(np.unique(before.cluster[corrected.outside])),
        covered=covered,
        half_width_m=half_widths,
    )


def _find_median(values: np.ndarray) -> float | None:
    return float(np.median(values)) if values.size else None


@dataclass(frozen=True)
class TrainingFolds:
    """M training observations of G configurations in K folds.

    Attributes
    ----------
    configuration : (M,) int array, 0 .. G-1
    fold : (M,) int array, 0 .. K-1, whole configurations in each
    residual : (M, 3) array
        Of the model fitted to all observations, m, base axes.
    residual_without : (K, M, 3) array
        Of the model fitted without each fold.
    """

    configuration: np.ndarray
    fold: np.ndarray
    residual: np.ndarray
    residual_without: np.ndarray

    @property
    def count(self) -> int:
        """Number of folds."""
        return len(self.residual_without)


def _choose_on_training(
    fitted: Fit, observations: Observations, plan: ResidualModelPlan
) -> RegressionChoice:
    """Choose a regression on the training observations of a fit."""
    sample = sample_observations(observations, _MAX_TO_CHOOSE)
    states = sample.states
    pose = index_poses(states)
    configuration = number_configurations(states.joint_angles, pose)
    configurations = configuration.max() + 1
    folds = min(_FOLDS, configurations)
    if plan.blocks:
        fold = partition_poses(states.joint_angles, pose, folds)
    else:
        stream = np.random.default_rng(plan.seed)
        fold = stream.permutation(configurations)[configuration] % folds
    residual_without = [
        compute_position_residuals(fitted.model, estimate, sample)
        for estimate in refit_without_folds(fitted, sample, fold[pose])
    ]
    training = TrainingFolds(
        configuration[sample.cluster],
        fold[sample.cluster],
        compute_position_residuals(fitted.model, fitted.estimate, sample),
        np.stack(residual_without),
    )
    names = [plan.regression]
    if plan.regression == BEST_REMAINDER:
        joints = states.joint_angles.shape[1]
        names = [
            name
            for name, regression in list_regressions().items()
            if len(sample) >= regression.min_rows(joints)
        ]
    inputs = build_inputs(fitted.model, fitted.estimate, sample)
    return choose_regression(names, inputs, training, plan.seed)


@dataclass(frozen=True)
class _FoldedInputs:
    """Inputs of M observations in K folds, of which unions are fitted.

    Attributes
    ----------
    inputs : of all observations
    members : (K, M) bool array, observations of each fold
    parts : inputs of each fold
    """

    inputs: Inputs
    members: np.ndarray
    parts: list[Inputs]

    @classmethod
    def of(cls, inputs: Inputs, folds: TrainingFolds) -> _FoldedInputs:
        """Divide the inputs of the training observations by their folds."""
        members = folds.fold == np.arange(folds.count)[:, None]
        return cls(inputs, members, [inputs.select(mask) for mask in members])

    def select_without(self, left_out: Collection[int]) -> tuple[Inputs, np.ndarray]:
        """Inputs of all folds but some, and which observations these are, (M,) of
        bool."""
        numbers = [n for n in range(len(self.parts)) if n not in left_out]
        chosen = np.asarray(self.members[numbers].any(axis=0))
        parts = tuple(self.parts[number] for number in numbers)
        return replace(self.inputs.select(chosen), parts=parts), chosen


def choose_regression(
    names: Sequence[str], inputs: Inputs, folds: TrainingFolds, seed: int
) -> RegressionChoice:
    """Choose a regression and its setting by nested cross-validation.

    The predictions of the outer folds also scale the intervals.

    Parameters
    ----------
    names : regressions to choose from
    inputs : Inputs of the training observations
    folds : TrainingFolds
    seed : of the regressions

    Returns
    -------
    RegressionChoice
        With an empty name if nothing is to be corrected.
    """
    nothing = RegressionChoice("", "", seed, None, None, None)
    configurations = int(folds.configuration.max()) + 1
    if configurations < MIN_CONFIGURATIONS:
        return nothing
    settings = {
        name: _list_settings(name, inputs, folds.residual, seed) for name in names
    }
    # The predictions that decide, and the last fit, estimate hyperparameters anew, by
    # nothing but what they are fitted to.
    candidates = [
        (name, setting)
        for name in settings
        for setting in list_regressions()[name].settings
    ]
    folded = _FoldedInputs.of(inputs, folds)
    products = _cross_validate(settings, folded, folds, seed)
    # Residuals of the model fitted without the fold of each observation.
    residual = folds.residual_without[folds.fold, np.arange(len(folds.fold))]
    predicted, std = _predict_outer_folds(candidates, products, folded, folds, seed)
    gain = estimate_gain(
        np.bincount(folds.configuration, (residual * predicted).sum(axis=1)),
        np.bincount(folds.configuration, (predicted**2).sum(axis=1)),
        len(residual),
        folds.count,
    )
    best = _find_best_candidate(products.sum(axis=(0, 1)))
    if gain.p_value > gain.level or best is None:
        return replace(nothing, left_out=gain)
    name, setting = candidates[best]
    return RegressionChoice(
        name,
        list_regressions()[name].description,
        seed,
        dict(setting),
        calibrate_intervals(np.abs(residual - gain.factor * predicted), std),
        gain,
    )


def _predict_outer_folds(
    candidates: Sequence[tuple[str, Setting]],
    products: np.ndarray,
    folded: _FoldedInputs,
    folds: TrainingFolds,
    seed: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Predict each fold by the regression that the other folds choose and fit.

    Parameters
    ----------
    candidates : regressions and settings
    products : result of `_cross_validate`
    folded, folds : inputs and residuals
    seed : of the regressions

    Returns
    -------
    predicted, std : (M, 3) arrays, m
        Zero, and not a number, if the other folds choose none.
    """
    predicted = np.zeros_like(folds.residual)
    std = np.full_like(folds.residual, np.nan)
    for number in range(folds.count):
        best = _find_best_candidate(products[number].sum(axis=0))
        if best is None:
            continue
        training_inputs, training = folded.select_without((number,))
        predictor = _fit_setting(
            *candidates[best],
            training_inputs,
            folds.residual_without[number, training],
            seed,
        )
        left_out = folded.members[number]
        predicted[left_out] = predictor.mean(folded.parts[number])
        std[left_out] = predictor.std(folded.parts[number])
    return predicted, std


def _list_settings(
    name: str, inputs: Inputs, residual: np.ndarray, seed: int
) -> Sequence[Setting]:
    """List the settings of a regression among which cross-validation chooses.

    Hyperparameters that a regression estimates are estimated once for all folds of this
    choice: they are few, and the search for them takes most of the time.
    """
    regression = list_regressions()[name]
    if regression.tune is None:
        return regression.settings
    return [regression.tune(inputs, residual, seed)]


def _cross_validate(
    settings: Mapping[str, Sequence[Setting]],
    folded: _FoldedInputs,
    folds: TrainingFolds,
    seed: int,
) -> np.ndarray:
    """Predict each fold by candidates that are fitted without it and one other fold.

    Returns a (K, K, candidates, 2) array, m²: products of the predictions with the
    residuals and with themselves, by the outer fold and by the predicted fold.
    """
    candidates = sum(map(len, settings.values()))
    products = np.zeros((folds.count, folds.count, candidates, 2))
    for pair in combinations(range(folds.count), 2):
        # Residuals of a model fitted without both folds, to first order in the changes
        # that leaving out each of them causes.
        residual = folds.residual_without[list(pair)].sum(axis=0) - folds.residual
        training_inputs, training = folded.select_without(pair)
        predictors = (
            predictor
            for name in settings
            for predictor in list_regressions()[name].fit(
                training_inputs, residual[training], settings[name], seed
            )
        )
        for number, predictor in enumerate(predictors):
            for outer, predicted in (pair, pair[::-1]):
                mean = predictor.mean(folded.parts[predicted])
                products[outer, predicted, number] = (
                    (residual[folded.members[predicted]] * mean).sum(),
                    (mean**2).sum(),
                )
    return products


def _find_best_candidate(products: np.ndarray) -> int | None:
    """Index of the candidate whose predictions reduce the squared error most.

    Each candidate is shrunk as it needs, but by no more than half. None if no candidate
    reduces the error. `products` (candidates, 2): see `_cross_validate`.
    """
    with_residual, with_itself = products.T
    slope = with_residual / np.maximum(with_itself, np.finfo(float).tiny)
    factor = np.clip(slope, 0.5, 1.0)
    reductions = factor * (2.0 * with_residual - factor * with_itself)
    best = int(np.argmax(reductions))
    return best if reductions[best] > 0.0 else None


def estimate_gain(
    with_residual: np.ndarray, with_itself: np.ndarray, positions: int, folds: int
) -> CrossValidatedGain:
    """Estimate what predictions gain on configurations that they were fitted without.

    The slope of the residuals on the predictions is less than one if a regression
    follows noise; it is shrunk once more as James and Stein shrink a mean [1]_. Folds
    share most of the configurations that they are fitted to. Therefore the mean of
    their errors has more variance than the mean of independent errors, by the factor
    1 + k / (k - 1) for k folds [2]_.

    Parameters
    ----------
    with_residual, with_itself : (G,) arrays
        Products of the predictions of each configuration with its residuals and with
        themselves, m².
    positions : number of predicted positions
    folds : number of folds

    Returns
    -------
    CrossValidatedGain
        The test uses the reduction of the squared error by shrunk predictions. The RMS
        of the predictable part is the root of the mean reduction before the second
        shrinkage.

    References
    ----------
    .. [1] James and Stein, Estimation with quadratic loss, Fourth Berkeley Symposium 1,
       1961.
    .. [2] Nadeau and Bengio, Inference for the generalization error, Machine Learning
       52, 2003.
    """
    count = len(with_residual)
    level = _LEVEL if count >= _FEW_CONFIGURATIONS else _STRICT_LEVEL
    inflation = (1.0 + folds / (folds - 1.0)) * count / (count - 1.0)
    slope = 0.0
    if with_itself.any():
        slope = with_residual.sum() / with_itself.sum()
    if slope <= 0.0:
        return CrossValidatedGain(0.0, 0.0, 1.0, 0.0, 0.0, level)
    deviations = with_residual - slope * with_itself
    slope_error = np.sqrt(inflation * (deviations**2).sum()) / with_itself.sum()
    factor = np.clip(slope - slope_error**2 / slope, 0.0, 1.0)
    factors = np.array([factor, min(slope, 1.0)])[:, None]
    reductions = factors * (2.0 * with_residual - factors * with_itself)
    deviations = reductions - reductions.mean(axis=1, keepdims=True)
    errors = np.sqrt(inflation * (deviations**2).sum(axis=1))
    shrunk_total, total = reductions.sum(axis=1)
    statistic = float(shrunk_total / errors[0]) if errors[0] > 0.0 else 0.0
    rms = float(np.sqrt(total / positions))
    return CrossValidatedGain(
        float(factor),
        statistic,
        float(stdtr(count - 1.0, -statistic)),
        rms,
        0.5 * rms * float(errors[1] / total),
        level,
    )


def calibrate_intervals(errors: np.ndarray, std: np.ndarray) -> Spread:
    """Scale standard deviations so that intervals hold `CONFIDENCE` of left-out errors.

    This is locally weighted conformal prediction [1]_ by cross-validation. The standard
    deviations of a regression say where it is less certain. Residuals of left-out poses,
    which include the errors of the physical model beyond its training poses, say how
    large the standard deviations must be.

    Parameters
    ----------
    errors : (M, 3) array, magnitudes, m
    std : (M, 3) array, stated standard deviations, m; not a number where none is stated

    References
    ----------
    .. [1] Lei, G'Sell, Rinaldo, Tibshirani and Wasserman, Distribution-free predictive
       inference for regression, Journal of the American Statistical Association 113,
       2018.
    """
    is_stated = np.isfinite(std)
    factor = None
    if is_stated.any():
        factor = _estimate_conformal_std(errors[is_stated] / std[is_stated])
    without_std = _estimate_conformal_std(errors)
    typical = float(np.sqrt((errors**2).mean())) / without_std
    return Spread(times=factor, otherwise_m=without_std, typical=typical)


def _estimate_conformal_std(scores: np.ndarray) -> float:
    """Quantile of the scores as the standard deviation of a normal distribution, with
    conformal prediction's correction for a finite sample."""
    level = min(CONFIDENCE * (1.0 + 1.0 / scores.size), 1.0)
    return float(np.quantile(scores, level, method="higher")) / NORMAL_QUANTILE
