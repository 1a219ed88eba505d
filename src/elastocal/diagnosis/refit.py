"""The exact fit of a selected model, and parameters averaged over models, so that
intervals are honest after selection.

The fit is maximum a posteriori, a generalized ridge regression (Hoerl and Kennard,
Technometrics 1970): coefficients keep the priors under which they were selected,
half-normal ones as normal, none wider than all sizes of the effect together made it
before the measurements: what asks for more is often something beside the law, which
fits where poses are and not between them.

What other models say differently is taken from the linearised problem (Bayesian model
averaging; Hoeting et al., Statistical Science 1999): the mean over models moves the
estimate, and their spread widens its standard error (law of total variance). Those of
an effect are averaged over its sizes and the models that have it: how large it is if it
is there.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.search import (
    ScoredModel,
    SearchProblem,
)
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import get_parameter_values
from elastocal.fitting.noise import set_prior_std
from elastocal.fitting.normal_equations import compute_whitening

if TYPE_CHECKING:
    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

    # Effects with normal priors on their parameters, and values of their shapes.
    SelectedEffects = tuple[tuple[Candidate, np.ndarray], ...]

# Of the mean square; each step leaves what the error common to a pose makes of it,
# which does not grow.
_NOISE_STEPS = 20
_NOISE_SETTLED = 0.02


def select_effects(linearized: CandidateDesign, model: ScoredModel) -> SelectedEffects:
    """What a model of the posterior is for the exact fit: without the competitor, which
    predicts nothing."""
    problem = linearized.problem
    effects = []
    for number, scale in zip(model.term_indices, model.scales, strict=True):
        unit = problem.terms[number]
        if unit.candidate:
            size = min(scale, problem.grid.root_mean_square(unit))
            effects.append(
                (
                    set_prior_std(unit.candidate, size * unit.sizes),
                    np.array(unit.shapes, float),
                )
            )
    return tuple(effects)


def fit_selected_effects(
    declared: Fit,
    observations: Observations,
    noise: Noise,
    chosen: SelectedEffects,
    near: Fit | None = None,
    **options: float,
) -> Fit:
    """Fit the declared model with the effects of a selected one.

    `declared`: where the search starts. `noise`: of measurements and poses, as the
    selected model leaves it. `near`: with other effects: the search then starts from
    its values of those that are the same. `**options`: of `fitting.fit`.
    """
    model = declared.model
    effects = [candidate for candidate, _ in chosen]
    start = declared.estimate.with_effects(effects)
    start = replace(
        start, shapes=(*declared.estimate.shapes, *(shapes for _, shapes in chosen))
    )
    if near is not None:
        met = {effect.key for effect in near.model.effects}
        values = zip((*model.effects, *effects), start.coefficients, strict=True)
        coefficients = tuple(
            near.effect_values(effect.key)[0] if effect.key in met else value
            for effect, value in values
        )
        start = replace(near.estimate, coefficients=coefficients, shapes=start.shapes)
    return fit_model(
        model.with_effects(effects),
        observations,
        noise,
        start,
        near is not None,
        **options,
    )


def predict_reduced_chi_square(problem: SearchProblem, model: ScoredModel) -> float:
    """Mean square of the whitened residual that a model leaves, by the linearised
    problem: 1 where noise accounts for it."""
    statistics = problem.statistics
    columns, coefficients, place = problem.find_mode(model)
    return float(
        (
            statistics.residual_squares[place]
            - statistics.score[place, columns] @ coefficients
        )
        / statistics.degrees_of_freedom
    )


def compute_reduced_chi_square(fitted: Fit) -> float:
    """The same of an exact fit, over all that is left free, its priors included: 1
    where it left the noise that it has."""
    white = fitted.whiten(fitted.residual)
    squares = (white**2).sum() + (
        (get_parameter_values(fitted.model, fitted.estimate) / fitted.prior_std) ** 2
    ).sum()
    return float(
        squares
        / (white.size - (np.isinf(fitted.prior_std) & ~fitted.unidentifiable).sum())
    )


def limit_pose_error(fitted: Fit, observations: Observations, pose_rad: float) -> Noise:
    """Noise of measurements that a fit leaves if those of a pose have no more in
    common: by it the mean square stays."""
    noise = replace(fitted.noise, pose_rad=min(fitted.noise.pose_rad, pose_rad))
    usual = (fitted.whiten(fitted.residual) ** 2).mean()
    residual = fitted.residual * np.sqrt(fitted.weights)[:, None]
    for _ in range(_NOISE_STEPS if fitted.joint_jacobian is not None else 0):
        over = (
            compute_whitening(observations, fitted.joint_jacobian, noise).apply(
                residual
            )
            ** 2
        ).mean() / usual
        noise = noise.scaled(float(np.sqrt(over)))
        if over < 1.0 + _NOISE_SETTLED:
            break
    return noise


def estimate_residual_noise(
    problem: SearchProblem, model: ScoredModel, taken: Noise, least: Noise
) -> Noise:
    """Noise as a model leaves it.

    `taken`: by which the problem was whitened. `least`: that repeats or the campaign
    say, below which it does not fall.
    """
    left = predict_reduced_chi_square(problem, model)
    factor = float(np.sqrt(max(left * (taken.position_m / least.position_m) ** 2, 1.0)))
    return replace(
        least.scaled(factor),
        pose_rad=float(np.sqrt(max(left, 1.0))) * model.pose_error_rad,
    )
