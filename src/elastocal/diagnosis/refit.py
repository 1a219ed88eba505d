"""The exact fit of a selected model, and the noise that a model leaves.

The fit is maximum a posteriori, a generalized ridge regression [1]_. Coefficients keep
the priors under which they were selected; half-normal priors become normal ones. No
prior is wider than all sizes of the effect together made it before the measurements: a
larger coefficient is often an error that does not follow the modelled effect, and such
a coefficient fits at the measured poses and not between them.

References
----------
.. [1] Hoerl and Kennard, Ridge regression, Technometrics 12, 1970.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.effects.gravity import DECLARED_WEIGHT
from elastocal.fitting.least_squares import CONVERGENCE_TOLERANCE, fit_model
from elastocal.fitting.model import get_parameter_values
from elastocal.fitting.noise import count_effective_parameters, set_prior_std
from elastocal.fitting.normal_equations import compute_whitening
from elastocal.fitting.sensor_noise import compute_sensor_roots

if TYPE_CHECKING:
    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.search import ScoredModel, SearchProblem
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

    # Effects with normal priors on their parameters, and values of their shapes.
    SelectedEffects = tuple[tuple[Candidate, np.ndarray], ...]

# Limits of the iteration for the noise beside a smaller pose error. Each step removes
# the excess that does not come from the pose error, and the remaining part of the mean
# square does not grow.
_MAX_NOISE_STEPS = 20
_NOISE_TOLERANCE = 0.02


def select_effects(design: CandidateDesign, model: ScoredModel) -> SelectedEffects:
    """Select the effects of a model for the exact fit, with their priors; without the
    discrepancy term, which predicts nothing elsewhere."""
    problem = design.problem
    effects = []
    for index, scale in zip(model.term_indices, model.scales, strict=True):
        term = problem.terms[index]
        if term.candidate is None:
            continue
        size = min(scale, problem.grid.root_mean_square(term))
        effect = set_prior_std(term.candidate, size * term.sizes)
        effects.append((effect, np.array(term.shapes, float)))
    return tuple(effects)


def reset_declared_masses(fitted: Fit) -> Fit:
    """Set the errors of the declared masses to zero in the estimate of a fit, where a
    fit with a law that is not linear in the load starts."""
    coefficients = tuple(
        np.zeros_like(values) if effect.effect == DECLARED_WEIGHT else values
        for effect, values in zip(
            fitted.model.effects, fitted.estimate.coefficients, strict=True
        )
    )
    return replace(fitted, estimate=replace(fitted.estimate, coefficients=coefficients))


def fit_selected_effects(
    declared: Fit,
    observations: Observations,
    noise: Noise,
    effects: SelectedEffects,
    near: Fit | None = None,
    tolerance: float = CONVERGENCE_TOLERANCE,
) -> Fit:
    """Fit the declared model with selected effects.

    Parameters
    ----------
    declared
        Fit of the declared model, from whose estimate the iteration starts.
    observations
        Measurements to fit.
    noise
        Noise of measurements and poses, as the selected model leaves it.
    effects
        Effects with their priors and values of their shapes.
    near
        A fit with other effects, if there is one. The iteration starts from its
        estimate, with its values of the effects that both models have.
    tolerance
        Convergence tolerance, in standard errors.
    """
    candidates = [candidate for candidate, _ in effects]
    model = declared.model.with_effects(candidates)
    estimate = declared.estimate
    shapes = (*estimate.shapes, *(values for _, values in effects))
    start = replace(estimate.with_effects(candidates), shapes=shapes)
    if near is not None:
        keys_near = {effect.key for effect in near.model.effects}
        coefficients = tuple(
            near.effect_values(effect.key)[0] if effect.key in keys_near else values
            for effect, values in zip(model.effects, start.coefficients, strict=True)
        )
        start = replace(near.estimate, coefficients=coefficients, shapes=shapes)
    return fit_model(
        model,
        observations,
        noise,
        start,
        reweight_first_step=near is not None,
        tolerance=tolerance,
    )


def predict_reduced_chi_square(problem: SearchProblem, model: ScoredModel) -> float:
    """Predict the mean square of the whitened residual of a model by the linearised
    problem; it is 1 if the noise accounts for the residual."""
    statistics = problem.statistics
    columns, coefficients, index = problem.find_mode(model)
    squares = (
        statistics.residual_squares[index]
        - statistics.score[index, columns] @ coefficients
    )
    return float(squares / statistics.degrees_of_freedom)


def compute_reduced_chi_square(fitted: Fit) -> float:
    """Compute the mean square of the whitened residual of an exact fit and of its
    priors, per degree of freedom; it is 1 if the noise of the fit accounts for it."""
    white = fitted.whiten(fitted.residual)
    values = get_parameter_values(fitted.model, fitted.estimate)
    squares = (white**2).sum() + ((values / fitted.prior_std) ** 2).sum()
    free_without_prior = np.isinf(fitted.prior_std) & ~fitted.unidentifiable
    return float(squares / (white.size - free_without_prior.sum()))


def limit_pose_error(fitted: Fit, observations: Observations, pose_rad: float) -> Noise:
    """Estimate the noise of measurements if a pose error is no larger than a limit.

    Parameters
    ----------
    fitted
        A fit, whose pose error may exceed the limit.
    observations
        Measurements that it was fitted to.
    pose_rad
        The limit.

    Returns
    -------
    Noise
        Noise by which the residual has the same mean square as by the noise of the fit.
    """
    noise = replace(fitted.noise, pose_rad=min(fitted.noise.pose_rad, pose_rad))
    jacobian = fitted.joint_jacobian
    if jacobian is None:
        return noise
    mean_square = (fitted.whiten(fitted.residual) ** 2).mean()
    residual = fitted.residual * np.sqrt(fitted.weights)[:, None]
    for _ in range(_MAX_NOISE_STEPS):
        roots = compute_sensor_roots(fitted.model, fitted.estimate, observations, noise)
        whitening = compute_whitening(observations, jacobian, noise, roots)
        white = whitening.apply(residual)
        excess = (white**2).mean() / mean_square
        noise = noise.scaled(float(np.sqrt(excess)))
        if excess < 1.0 + _NOISE_TOLERANCE:
            break
    return noise


def estimate_sensor_noise(fitted: Fit, observations: Observations) -> Noise:
    """Estimate the noise that a fit leaves if all of it came from the sensor, without
    errors of joints and poses.

    Parameters
    ----------
    fitted
        A fit.
    observations
        Measurements that it was fitted to.

    Returns
    -------
    Noise
        Noise by which the residual has a mean square of 1 per degree of freedom.
    """
    noise = replace(
        fitted.noise, joint_rad=np.zeros_like(fitted.noise.joint_rad), pose_rad=0.0
    )
    residual = fitted.residual * np.sqrt(fitted.weights)[:, None]
    roots = compute_sensor_roots(fitted.model, fitted.estimate, observations, noise)
    white = compute_whitening(observations, None, noise, roots).apply(residual)
    degrees_of_freedom = white.size - count_effective_parameters(fitted)
    mean_square = (white**2).sum() / max(degrees_of_freedom, 1.0)
    return noise.scaled(float(np.sqrt(max(mean_square, 1.0))))


def estimate_residual_noise(
    problem: SearchProblem, model: ScoredModel, whitening_noise: Noise, lowest: Noise
) -> Noise:
    """Estimate the noise that a model leaves, by the linearised problem.

    Parameters
    ----------
    problem
        The linearised problem.
    model
        One of its models.
    whitening_noise
        Noise by which the problem was whitened.
    lowest
        Noise that repeats show or the campaign declares, below which the estimate does
        not fall.
    """
    chi_square = predict_reduced_chi_square(problem, model)
    ratio = whitening_noise.position_m / lowest.position_m
    factor = float(np.sqrt(max(chi_square * ratio**2, 1.0)))
    pose_rad = float(np.sqrt(max(chi_square, 1.0))) * model.pose_error_rad
    return replace(lowest.scaled(factor), pose_rad=pose_rad)
