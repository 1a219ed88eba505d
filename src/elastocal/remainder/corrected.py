"""A regression on what a fitted model leaves, tuned on its training poses, and what both make of poses that no fit has seen."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, cast

import numpy as np

import elastocal.remainder
from elastocal.campaigns.campaign import BEST_REMAINDER
from elastocal.campaigns.holdout import blocks_of_poses, configurations
from elastocal.effects.catalogue import effects, moves_robot
from elastocal.fitting.least_squares import fit_frames
from elastocal.fitting.linearization import effect_columns
from elastocal.fitting.model import conditions, target_points
from elastocal.fitting.observations import sample_of, state_clusters
from elastocal.io.modules import modules_with
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.remainder.protocol import Folds, Inputs
from elastocal.remainder.tuning import CONFIDENCE, NORMAL_WIDTH, Spread, shrunk, tuned
from elastocal.validation.held_out import Errors, intervals, position_errors, position_residuals, refits, summary
from elastocal.validation.placing import beyond_campaign, placed, same_campaign

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.observations import Observations, States
    from elastocal.remainder.protocol import Predictor, Regression
    from elastocal.remainder.tuning import Tuned

# A regression is chosen by so many observations at most; the quantile that scales its intervals they fix to two per cent.
_FOLDS, _MOST_TO_CHOOSE, _REPLICATES = 5, 2_000, 1000
# Share of a joint's fitted range beside it within which a regression is added too: no pose has neighbours that near, and of
# poses drawn like 200 fitted ones some 3 % would go without for standing a hundredth beyond.
_BESIDE = 0.05
# A usual size of an effect is as easily taken back as so much of a joint is added.
_RAD_OF_A_SIZE = 1e-3
# A correction knows of no time or temperature, so that it takes back nothing of what goes by them.
_UNKNOWN_OF_TASKS = {"time", "temperature"}


@cache
def regressions() -> dict[str, Regression]:
    """All regressions by their names: each module of this package that has a NAME."""
    return {module.NAME: cast("Regression", module) for module in modules_with("NAME", elastocal.remainder).values()}


@dataclass(frozen=True)
class Plan:
    """How a remainder is to be regressed.

    `regression`: its name; `BEST_REMAINDER` for that which left-out poses choose. `blocks`: whether folds are blocks of joint
    space, as for poses far from those fitted; else they are random. `within_range`: whether nothing is corrected beyond the
    joint angles and loads that were fitted.
    """

    regression: str
    blocks: bool
    within_range: bool
    seed: int


@dataclass(frozen=True)
class Corrected:
    """What a model and a regression leave of poses that they have not seen; arrays of M.

    `residual` (M, 3): measured less predicted positions, m, base axes. `std` (M, 3): standard deviation stated for them, m;
    None where there is no regression. `outside` (M,) of bool: beyond the joint angles or loads that were fitted.
    `chosen`: regression and setting, and what they gain on left-out training poses; none of them where nothing is corrected.
    """

    residual: np.ndarray
    std: np.ndarray | None
    outside: np.ndarray
    chosen: Tuned


def corrected(plan: Plan, fitted: Fit, case: Case, held_out: Case) -> Corrected:
    """Predict held-out poses by a model and a regression on what it leaves of the training poses.

    Whether there is one, its setting, size and intervals come from cross-validation of the training poses, with the model
    fitted anew without each fold. Poses of another campaign have their frames and targets fitted to what both leave of them.

    `fitted`: to the training poses. `case`: of the training poses.
    """
    there, (model, estimate) = held_out.observations, placed(fitted, case, held_out)
    found = chosen(plan, fitted, case.observations)
    prediction = found.predictor(inputs_of(model, estimate, there))
    outside = beyond_regressed(case.observations.states, there.states.joint_angles, there.states.wrench)[there.state]
    mean = np.where(outside[:, None] & plan.within_range, 0.0, prediction.mean)
    if not same_campaign(case, held_out):
        session = np.searchsorted(estimate.sessions, there.states.session[there.state])
        moved = there.position - (estimate.frame_rotation[session] @ mean[..., None])[..., 0]
        known = replace(fitted, model=model, estimate=estimate)
        estimate = fit_frames(known, model, replace(there, position=moved))
    return Corrected(position_residuals(model, estimate, there) - mean, prediction.std, outside, found)


def beyond_regressed(fitted: States, joint_angles: np.ndarray, wrench: np.ndarray | None) -> np.ndarray:
    """Where no regression is added, ndarray of bool (N,): beyond the loads that were fitted, and joint angles with a margin.

    `joint_angles` (N, n): of the chain, rad. `wrench` (N, 6): N, N m; None for none.
    """
    low, high = fitted.joint_angles.min(axis=0), fitted.joint_angles.max(axis=0)
    middle = 0.5 * (low + high)
    return beyond_campaign(fitted, middle + (joint_angles - middle) / (1.0 + 2.0 * _BESIDE), wrench)


def chosen(plan: Plan, fitted: Fit, seen: Observations) -> Tuned:
    """The regression on what a model leaves of the observations that it was fitted to, or none."""
    among = [each for name, each in regressions().items() if plan.regression in (name, BEST_REMAINDER)]
    folds = _folds(plan, fitted, sample_of(seen, _MOST_TO_CHOOSE))
    inputs = inputs_of(fitted.model, fitted.estimate, seen)
    return tuned(among, folds, inputs, fitted.residual[:, :3], plan.seed)


def fitted_again(facts: Mapping[str, Any], model: Model, estimate: Estimate, seen: Observations) -> Predictor:
    """The regression that `remainder_facts` tells of, fitted to the same observations."""
    found = regressions()[facts["regression"]], facts["setting"], facts["left_out"]["factor"], Spread(**facts["spread"])
    return shrunk(*found, inputs_of(model, estimate, seen), position_residuals(model, estimate, seen), facts["seed"])


def _folds(plan: Plan, fitted: Fit, observations: Observations) -> Folds:
    """Training poses in folds, the model fitted anew without each."""
    states, model = observations.states, fitted.model
    pose = state_clusters(states)
    configuration = configurations(states.joint_angles, pose)
    count = min(_FOLDS, configuration.max() + 1)
    if plan.blocks:
        fold = blocks_of_poses(states.joint_angles, pose, count)
    else:
        fold = np.random.default_rng(plan.seed).permutation(configuration.max() + 1)[configuration] % count
    residual = np.empty((count, len(observations), 3))
    for number, refit in enumerate(refits(fitted, observations, fold[pose])):
        mine = refit.within[observations.state]
        residual[number, ~mine] = position_residuals(model, refit.estimate, refit.rest)
        residual[number, mine] = position_residuals(model, refit.there, refit.left_out)
    each, inputs = observations.cluster, inputs_of(model, fitted.estimate, observations)
    return Folds(inputs, configuration[each], fold[each], position_residuals(model, fitted.estimate, observations), residual)


def inputs_of(model: Model, estimate: Estimate, observations: Observations) -> Inputs:
    """Inputs of a regression, from the nominal chain and the places of the targets; `estimate` says where these sit.

    What the model's effects do stands beside the Jacobian: an effect that was adopted wrongly has taken its part of an error
    that no effect is, and a regression that cannot give it back has the rest of the error and the effect to make up for.
    """
    states, chain = observations.states, model.sites.chain
    coordinates = chain.at(states.joint_angles)
    jacobian = np.empty((len(observations), 3, chain.coordinates))
    for number, point in enumerate(target_points(model, estimate)):
        mask = observations.target == number
        jacobian[mask] = poses_and_jacobians(chain, coordinates[observations.state[mask]], point)[2][:, :3]
    found = [
        (effect, shapes)
        for effect, shapes in zip(model.effects, estimate.shapes, strict=True)
        if effect.effect in effects() and moves_robot(effect) and _UNKNOWN_OF_TASKS.isdisjoint(effect.needs)
    ]
    if found:
        sizes = np.array([parameter.plausible for effect, _ in found for parameter in effect.parameters])
        columns = effect_columns(found, conditions(model, estimate, states), jacobian, observations.state)
        jacobian = np.concatenate([jacobian, columns * sizes / _RAD_OF_A_SIZE], axis=2)
    others = np.hstack([states.wrench[observations.state], estimate.target_offset[observations.target]])
    return Inputs(states.joint_angles[observations.state], others, jacobian)


def remainder_facts(
    found: Corrected, declared: Fit, final: Fit, case: Case, held_out: Case, draws: np.random.Generator
) -> dict[str, Any]:
    """Held-out errors with a regression on what the final model leaves, beside those without.

    `declared`, `final`: to the training poses. `case`: of the training poses. `draws`: of the bootstrap over poses. Returns
    ``regression``, empty where none is used, its ``words``, ``setting``, ``spread`` and ``seed``; ``left_out``, the `Gain` on
    training poses by which it is used or not, with the ``level`` of that test; ``errors``, the summary of `held_out.summary`
    with it; ``rms_ci95_m``; of the squared error that the declared model leaves the shares that effects
    (``physics``) and the regression (``regression_share``) explain and that is ``left``; ``reduction_ci95`` of the RMS by the
    regression alone; ``covered``, the share of coordinates inside the stated 95 % intervals, and ``half_width_m``, half of
    their median width within and outside the range; ``outside``, poses beyond the joint angles or loads that were fitted, at
    which nothing is corrected.
    """
    before, after = (position_errors(*placed(fitted, case, held_out), held_out.observations) for fitted in (declared, final))
    with_it = Errors(np.linalg.norm(found.residual, axis=1), before.cluster)
    limits, reductions = intervals([after, with_it], _REPLICATES, draws)
    squares = [float((errors.distance**2).mean()) for errors in (before, after, with_it)]
    regression, gain, covered, half_width = found.chosen.regression, found.chosen.gain, None, None
    if found.std is not None:
        width = NORMAL_WIDTH * found.std
        covered = float((np.abs(found.residual) < width).mean())
        each = {"within": width[~found.outside], "outside": width[found.outside]}
        half_width = {name: float(np.median(part)) if part.size else None for name, part in each.items()}
    return {
        "regression": regression.NAME if regression else "",
        "words": regression.WORDS if regression else "",
        "seed": found.chosen.seed,
        "setting": found.chosen.setting and dict(found.chosen.setting),
        "spread": found.chosen.spread and asdict(found.chosen.spread),
        "left_out": None if gain is None else asdict(gain) | {"level": found.chosen.level},
        "errors": {name: float(value) for name, value in summary(with_it.distance).items()},
        "rms_ci95_m": [float(end) for end in limits[1]["rms_m"]],
        "reduction_ci95": [reductions[1].low, reductions[1].high],
        "physics": 1.0 - squares[1] / squares[0],
        "regression_share": (squares[1] - squares[2]) / squares[0],
        "left": squares[2] / squares[0],
        "outside": len(np.unique(before.cluster[found.outside])),
        "confidence": CONFIDENCE,
        "covered": covered,
        "half_width_m": half_width,
    }
