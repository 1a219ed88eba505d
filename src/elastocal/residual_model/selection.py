"""A regression on what a fitted model leaves, chosen by its training poses, and what
both make of poses that no fit has seen.

The best of many settings is a winner by luck. So each outer fold of the training poses
is predicted by what the others choose among themselves and fit (nested cross-validation
[1]), and those predictions decide whether anything is corrected, by one test over
configurations, and how much of the correction is kept, by a slope of at most one.

[1] Varma, S. and Simon, R., Bias in error estimation when using cross-validation for model selection, BMC Bioinformatics 7,
    2006.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any

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
    find_beyond_campaign,
    is_same_campaign,
    transfer_fit,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.observations import Observations, States

CONFIDENCE = 0.95
# Half width of the interval that holds 95 % of a normal distribution, in standard
# deviations.
NORMAL_QUANTILE = 1.959964
# How often a regression is chosen where nothing is left. A few configurations leave the
# outer folds' fits so unlike the final one that they must be surer; of fewer yet, a
# fold of a fold leaves nothing to regress.
_LEVEL = 0.05
_LEVEL_OF_FEW = 0.01
_FEW = 40
MIN_CONFIGURATIONS = 10
# A regression is chosen by so many observations at most; the quantile that scales its
# intervals they fix to two per cent. It is fitted to so many: of a million a process
# takes eight minutes, and its 2,000 values have been determined by far fewer.
_FOLDS = 5
_MOST_TO_CHOOSE = 2_000
_MOST_TO_FIT = 10_000
_REPLICATES = 1000
# Share of a joint's fitted range beside it within which a regression is added too: no
# pose has neighbours that near, and of poses drawn like 200 fitted ones some 3 % would
# go without for standing a hundredth beyond.
_BESIDE = 0.05
# A usual size of an effect is as easily taken back as so much of a joint is added.
_RAD_OF_A_SIZE = 1e-3
# What no command states, as `effects.conditions.find_offered_needs` names it.
_NOT_STATED = {"approach", "time", "temperature"}


@dataclass(frozen=True)
class CorrectedResiduals:
    """What a model and a regression leave of poses that they have not seen; arrays of
    M.

    `residual` (M, 3): measured less predicted positions, m, base axes. `std` (M, 3):
    standard deviation stated for them, m. `outside` (M,) of bool: beyond the joint
    angles or loads that were fitted. `chosen`: facts of `tuned`. `predictor`: of what
    is left. `std` and `predictor` are None where nothing is corrected.
    """

    residual: np.ndarray
    std: np.ndarray | None
    outside: np.ndarray
    chosen: Mapping[str, Any]
    predictor: Predictor | None


def validate_residual_model(
    fitted: Fit,
    case: Case,
    held_out: Case,
    regression: str,
    *,
    blocks: bool,
    within_range: bool,
    seed: int,
) -> CorrectedResiduals:
    """Predict held-out poses by a model and a regression on what it leaves of the
    training poses.

    Whether there is one, its setting, size and intervals come from cross-validation of
    the training poses, with the model fitted anew without each fold. Poses of another
    campaign have their frames and targets fitted to what both leave of them.

    `fitted`: to the training poses. `case`: of the training poses. `regression`: its
    name; `BEST_REMAINDER` for that which left-out poses choose. `blocks`: whether folds
    are blocks of joint space, as for poses far from those fitted; else they are random.
    `within_range`: whether nothing is corrected beyond the joint angles and loads that
    were fitted.
    """
    there, (model, estimate) = (
        held_out.observations,
        transfer_fit(fitted, case, held_out),
    )
    names = [
        name for name in list_regressions() if regression in (name, BEST_REMAINDER)
    ]
    every = case.observations
    some = sample_observations(case.observations, _MOST_TO_CHOOSE)
    inputs = build_inputs(fitted.model, fitted.estimate, some)
    chosen = _chosen(fitted, some, inputs, names, blocks, seed)
    outside = find_beyond_regression(
        every.states, there.states.joint_angles, there.states.wrench
    )[there.state]
    mean = np.zeros((len(there), 3))
    std = None
    predictor = None
    if chosen["regression"]:
        predictor = fit_to_observations(chosen, fitted.model, fitted.estimate, every)
        asked = build_inputs(
            model, estimate, there, list_regressions()[chosen["regression"]].by_jacobian
        )
        mean = np.where(outside[:, None] & within_range, 0.0, predictor.mean(asked))
        std = predictor.std(asked)
    if not is_same_campaign(case, held_out):
        session = np.searchsorted(estimate.sessions, there.states.session[there.state])
        moved = (
            there.position
            - (estimate.frame_rotation[session] @ mean[..., None])[..., 0]
        )
        known = replace(fitted, model=model, estimate=estimate)
        estimate = fit_placement(known, model, replace(there, position=moved))
    return CorrectedResiduals(
        compute_position_residuals(model, estimate, there) - mean,
        std,
        outside,
        chosen,
        predictor,
    )


def is_commanded(effect: Candidate) -> bool:
    """Whether a correction contains an effect: one that moves the robot, by what a
    command states."""
    return moves_robot(effect) and effect.needs.isdisjoint(_NOT_STATED)


def find_beyond_regression(
    fitted: States, joint_angles: np.ndarray, wrench: np.ndarray | None
) -> np.ndarray:
    """Where no regression is added, ndarray of bool (N,): beyond the loads that were
    fitted, and joint angles with a margin.

    `joint_angles` (N, n): of the chain, rad. `wrench` (N, 6): N, N m; None for none.
    """
    low = fitted.joint_angles.min(axis=0)
    high = fitted.joint_angles.max(axis=0)
    middle = 0.5 * (low + high)
    return find_beyond_campaign(
        fitted, middle + (joint_angles - middle) / (1.0 + 2.0 * _BESIDE), wrench
    )


def _chosen(
    fitted: Fit,
    observations: Observations,
    inputs: Inputs,
    names: Sequence[str],
    blocks: bool,
    seed: int,
) -> dict[str, Any]:
    """As `tuned`, of training poses in folds, with the model fitted anew without
    each."""
    states = observations.states
    model = fitted.model
    pose = index_poses(states)
    each = observations.cluster
    configuration = number_configurations(states.joint_angles, pose)
    count = min(_FOLDS, configuration.max() + 1)
    shuffled = (
        np.random.default_rng(seed).permutation(configuration.max() + 1)[configuration]
        % count
    )
    fold = partition_poses(states.joint_angles, pose, count) if blocks else shuffled
    without = np.stack(
        [
            compute_position_residuals(model, other, observations)
            for other in refit_without_folds(fitted, observations, fold[pose])
        ]
    )
    whole = compute_position_residuals(model, fitted.estimate, observations)
    return choose_regression(
        names, inputs, configuration[each], fold[each], whole, without, seed
    )


def fit_to_observations(
    chosen: Mapping[str, Any],
    model: Model,
    estimate: Estimate,
    observations: Observations,
) -> Predictor:
    """`fitted_again`, to what a model leaves of its training poses."""
    some = sample_observations(observations, _MOST_TO_FIT)
    by_jacobian = list_regressions()[chosen["regression"]].by_jacobian
    return fitted_again(
        chosen,
        build_inputs(model, estimate, some, by_jacobian),
        compute_position_residuals(model, estimate, some),
    )


def fitted_again(
    chosen: Mapping[str, Any], inputs: Inputs, residual: np.ndarray
) -> Predictor:
    """The regression of facts of `tuned`, fitted to residuals (M, 3), shrunk, with
    intervals as wide as poses left out say."""
    fitted = list_regressions()[chosen["regression"]].fitted
    spread = chosen["spread"]
    found = next(fitted(inputs, residual, [chosen["setting"]], chosen["seed"]))

    def std(there: Inputs) -> np.ndarray:
        stated = (
            np.nan if spread["times"] is None else spread["times"] * found.std(there)
        )
        return np.where(
            np.isfinite(stated), stated, np.full((len(there), 3), spread["otherwise_m"])
        )

    return Predictor(
        lambda there: chosen["left_out"]["factor"] * found.mean(there), std
    )


def build_geometric_inputs(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    by_jacobian: bool = True,
) -> Inputs:
    """Inputs of a regression, from the nominal chain and the places of the targets
    alone; `estimate` says where these sit.

    `by_jacobian`: whether it looks at the Jacobian, which else has no columns.
    """
    states = observations.states
    chain = model.sites.chain
    seen = observations.state
    others = np.hstack(
        [states.wrench[seen], estimate.target_offset[observations.target]]
    )
    jacobian = np.empty((len(observations), 3, 0))
    if by_jacobian:
        coordinates = chain.at(states.joint_angles)[seen]
        jacobian = compute_position_jacobians(
            chain, coordinates, locate_targets(model, estimate), observations.target
        )
    return Inputs(states.joint_angles[seen], others, jacobian)


def build_inputs(
    model: Model,
    estimate: Estimate,
    observations: Observations,
    by_jacobian: bool = True,
) -> Inputs:
    """Inputs of a regression on what a model leaves: `geometric_inputs_of`, and what
    the model's effects do.

    The latter stands beside the Jacobian: an effect that was adopted wrongly has taken
    its part of an error that no effect is, and a regression that cannot give it back
    has the rest of the error and the effect to make up for.
    """
    inputs = build_geometric_inputs(model, estimate, observations, by_jacobian)
    every = zip(model.effects, estimate.shapes, strict=True)
    found = [
        (effect, shapes)
        for effect, shapes in every
        if effect.effect in list_effects() and is_commanded(effect)
    ]
    if not found or not by_jacobian:
        return inputs
    sizes = np.array(
        [parameter.plausible for effect, _ in found for parameter in effect.parameters]
    )
    around = evaluate_conditions(model, estimate, observations.states)
    laws = [(effect.displacement, shapes) for effect, shapes in found]
    columns = compute_effect_sensitivities(
        laws, around, inputs.jacobian, observations.state, sizes / _RAD_OF_A_SIZE
    )
    return replace(inputs, jacobian=np.concatenate([inputs.jacobian, columns], axis=2))


def summarize_residual_model(
    found: CorrectedResiduals,
    declared: Fit,
    final: Fit,
    case: Case,
    held_out: Case,
    draws: np.random.Generator,
) -> dict[str, Any]:
    """Held-out errors with a regression on what the final model leaves, beside those
    without.

    `declared`, `final`: to the training poses. `case`: of the training poses. `draws`:
    of the bootstrap over poses. Returns the facts of `tuned`, and ``errors``, the
    summary of `held_out.summarize_errors` with it; ``rms_ci95_m``; of the squared error that the
    declared model leaves the shares that effects (``physics``) and the regression
    (``regression_share``) explain and that is ``left``; ``reduction_ci95`` of the RMS
    by the regression alone; ``covered``, the share of coordinates inside the stated 95
    % intervals, and ``half_width_m``, half of their median width within and outside the
    range; ``outside``, poses beyond the joint angles or loads that were fitted, at
    which nothing is corrected.
    """
    before, after = (
        compute_position_errors(
            *transfer_fit(fitted, case, held_out), held_out.observations
        )
        for fitted in (declared, final)
    )
    with_it = PositionErrors(np.linalg.norm(found.residual, axis=1), before.cluster)
    limits, reductions = compute_error_intervals([after, with_it], _REPLICATES, draws)
    squares = [
        float((errors.distance**2).mean()) for errors in (before, after, with_it)
    ]
    covered = half_width = None
    if found.std is not None:
        width = NORMAL_QUANTILE * found.std
        covered = float((np.abs(found.residual) < width).mean())
        each = {"within": width[~found.outside], "outside": width[found.outside]}
        half_width = {
            name: float(np.median(part)) if part.size else None
            for name, part in each.items()
        }
    return {
        **found.chosen,
        "errors": summarize_errors(with_it.distance),
        "rms_ci95_m": [float(end) for end in limits[1]["rms_m"]],
        "reduction_ci95": [reductions[1].low, reductions[1].high],
        "physics": 1.0 - squares[1] / squares[0],
        "regression_share": (squares[1] - squares[2]) / squares[0],
        "left": squares[2] / squares[0],
        "outside": len(np.unique(before.cluster[found.outside])),
        "covered": covered,
        "half_width_m": half_width,
    }


def choose_regression(
    names: Sequence[str],
    inputs: Inputs,
    group: np.ndarray,
    fold: np.ndarray,
    whole: np.ndarray,
    without: np.ndarray,
    seed: int,
) -> dict[str, Any]:
    """Choose one of some regressions and its setting by nested cross-validation; its
    outer folds make intervals honest too.

    `inputs`: of M training observations. `group`, `fold` (M,): configuration of each, 0
    .. G-1, and its fold, 0 .. K-1. `whole` (M, 3): residuals of the model fitted to all
    of them, m, base axes. `without` (K, M, 3): without each fold. Returns what
    `fitted_again` needs: ``regression``, empty where nothing is to be corrected, its
    ``words``, ``setting``, ``spread``, see `spread_of`, and ``seed``; ``left_out``, see
    `gain_of`, with the ``level`` of the test that it had to pass, None where there are
    too few configurations.
    """
    facts: dict[str, Any] = {
        "regression": "",
        "words": "",
        "seed": seed,
        "setting": None,
        "spread": None,
        "left_out": None,
    }
    if (count := int(group.max()) + 1) < MIN_CONFIGURATIONS:
        return facts
    pairs = [
        (name, setting)
        for name in names
        for setting in list_regressions()[name].settings
    ]
    mine = [fold == number for number in range(len(without))]
    parts = [inputs.select(each) for each in mine]
    # Of predictions of a fold (second) without it and another (first): products with
    # the residuals, and with themselves, m².
    products = np.zeros((len(mine), len(mine), len(pairs), 2))
    for pair in combinations(range(len(mine)), 2):
        # Of a model without both, to first order of what leaving out each of them does
        # to it.
        left = without[list(pair)].sum(axis=0) - whole
        rest = ~np.isin(fold, pair)
        some = inputs.select(rest)
        each = [list_regressions()[name] for name in names]
        fits = (
            one
            for regression in each
            for one in regression.fitted(some, left[rest], regression.settings, seed)
        )
        for number, predictor in enumerate(fits):
            for other, one in (pair, pair[::-1]):
                mean = predictor.mean(parts[one])
                products[other, one, number] = (
                    (left[mine[one]] * mean).sum(),
                    (mean**2).sum(),
                )
    off = without[fold, np.arange(len(fold))]
    predicted = np.zeros_like(off)
    std = np.full_like(off, np.nan)
    for number, (some, within) in enumerate(zip(parts, mine, strict=True)):
        best = _best(products[number].sum(axis=0))
        if best is not None:
            name, setting = pairs[best]
            predictor = next(
                list_regressions()[name].fitted(
                    inputs.select(~within), without[number, ~within], [setting], seed
                )
            )
            predicted[within] = predictor.mean(some)
            std[within] = predictor.std(some)
    along, square = (
        np.bincount(group, (rows * predicted).sum(axis=1)) for rows in (off, predicted)
    )
    gain = estimate_gain(along, square, len(off), len(mine))
    level = _LEVEL if count >= _FEW else _LEVEL_OF_FEW
    facts["left_out"] = gain | {"level": level}
    best = _best(products.sum(axis=(0, 1)))
    if gain["p_value"] > level or best is None:
        return facts
    name, setting = pairs[best]
    spread = calibrate_intervals(np.abs(off - gain["factor"] * predicted), std)
    return facts | {
        "regression": name,
        "words": list_regressions()[name].words,
        "setting": dict(setting),
        "spread": spread,
    }


def estimate_gain(
    along: np.ndarray, square: np.ndarray, rows: int, folds: int
) -> dict[str, float]:
    """What predictions gain on configurations that they were made without.

    Their slope on the residuals is less than one where a regression follows noise; it
    is shrunk once more as a mean is by James and Stein [1]. Folds share most of the
    configurations that they are fitted to, which leaves the mean of their errors more
    variance than independent ones would have, by 1 + k / (k - 1) of k folds [2].

    `along`, `square` (G,): of each configuration the products of predictions with
    residuals and with themselves, m². `rows`: positions predicted. `folds`: their
    number. Returns ``factor``, in [0, 1], by which predictions are to be multiplied;
    ``statistic``, Student's t of the mean fall of the squared error by these, over
    configurations; ``p_value``, that chance alone makes it so large; ``rms_m`` and
    ``rms_std_error_m``, what is predictable of each position, m: root of the mean fall
    before the second shrinkage.

    [1] James, W. and Stein, C., Estimation with quadratic loss, Fourth Berkeley
    Symposium 1, 1961. [2] Nadeau, C. and Bengio, Y., Inference for the generalization
    error, Machine Learning 52, 2003.
    """
    count = len(along)
    shared = (1.0 + folds / (folds - 1.0)) * count / (count - 1.0)
    slope = along.sum() / square.sum() if square.any() else 0.0
    if slope <= 0.0:
        return {
            "factor": 0.0,
            "statistic": 0.0,
            "p_value": 1.0,
            "rms_m": 0.0,
            "rms_std_error_m": 0.0,
        }
    error = np.sqrt(shared * ((along - slope * square) ** 2).sum()) / square.sum()
    kept = np.array([np.clip(slope - error**2 / slope, 0.0, 1.0), min(slope, 1.0)])[
        :, None
    ]
    falls = kept * (2.0 * along - kept * square)
    spread = np.sqrt(
        shared * ((falls - falls.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    )
    statistic = float(falls[0].sum() / spread[0]) if spread[0] > 0.0 else 0.0
    rms = float(np.sqrt(falls[1].sum() / rows))
    found = {
        "factor": float(kept[0, 0]),
        "statistic": statistic,
        "p_value": float(stdtr(count - 1.0, -statistic)),
    }
    return found | {
        "rms_m": rms,
        "rms_std_error_m": 0.5 * rms * float(spread[1] / falls[1].sum()),
    }


def _best(products: np.ndarray) -> int | None:
    """The setting whose predictions gain most, shrunk as they need but by no more than
    half; None where none gains.

    `products` (settings, 2).
    """
    along, square = products.T
    factor = np.clip(along / np.maximum(square, np.finfo(float).tiny), 0.5, 1.0)
    gains = factor * (2.0 * along - factor * square)
    best = int(np.argmax(gains))
    return best if gains[best] > 0.0 else None


def calibrate_intervals(errors: np.ndarray, std: np.ndarray) -> dict[str, float | None]:
    """How large standard deviations must be for intervals to hold `CONFIDENCE` of the
    errors of poses left out.

    Locally weighted conformal prediction [1] by cross-validation: a regression's own
    standard deviations say where it is less sure, residuals of poses left out, with
    what the physical model errs by beyond its training poses, how large these must be.

    `errors`, `std` (M, 3): magnitudes, and what was stated for them, not a number where
    nothing was. Returns ``times``, by how much stated ones are to be multiplied, None
    where there are none; ``otherwise_m``, of a coordinate where none is stated;
    ``typical``, root mean square of the errors over that, which tails make large.

    [1] Lei, J., G'Sell, M., Rinaldo, A., Tibshirani, R. J. and Wasserman, L., Distribution-free predictive inference for
        regression, Journal of the American Statistical Association 113, 2018.
    """

    def width(scores: np.ndarray) -> float:
        # The quantile with conformal prediction's correction for a finite sample; the
        # largest where that asks for more.
        return (
            float(
                np.quantile(
                    scores,
                    min(CONFIDENCE * (1.0 + 1.0 / scores.size), 1.0),
                    method="higher",
                )
            )
            / NORMAL_QUANTILE
        )

    own = np.isfinite(std)
    otherwise = width(errors)
    times = width(errors[own] / std[own]) if own.any() else None
    return {
        "times": times,
        "otherwise_m": otherwise,
        "typical": float(np.sqrt((errors**2).mean())) / otherwise,
    }
