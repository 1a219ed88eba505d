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

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.evidence import Joint
from elastocal.diagnosis.search import (
    UNLIKELY,
    Model,
    Posterior,
    Problem,
    solve_positive,
)
from elastocal.diagnosis.statistics import Statistics, normal_equations
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import get_parameter_values
from elastocal.fitting.noise import set_prior_std
from elastocal.fitting.normal_equations import compute_whitening

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from elastocal.diagnosis.linearize import Linearized
    from elastocal.effects.protocol import Candidate
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

    # Effects with normal priors on their parameters, and values of their shapes.
    Selected = tuple[tuple[Candidate, np.ndarray], ...]

# Of the mean square; each step leaves what the error common to a pose makes of it,
# which does not grow.
_NOISE_STEPS = 20
_NOISE_SETTLED = 0.02
# Models that hold less than this move no digit that is reported.
_LEAST_PROBABILITY = 0.002


def selected(linearized: Linearized, model: Model) -> Selected:
    """What a model of the posterior is for the exact fit: without the competitor, which
    predicts nothing."""
    problem = linearized.problem
    effects = []
    for number, scale in zip(model.units, model.scales, strict=True):
        unit = problem.units[number]
        if unit.candidate:
            size = min(scale, problem.grid.root_mean_square(unit))
            effects.append(
                (
                    set_prior_std(unit.candidate, size * unit.sizes),
                    np.array(unit.shapes, float),
                )
            )
    return tuple(effects)


def fit_with_sizes(
    declared: Fit,
    observations: Observations,
    noise: Noise,
    chosen: Selected,
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


def mean_square_left(problem: Problem, model: Model) -> float:
    """Mean square of the whitened residual that a model leaves, by the linearised
    problem: 1 where noise accounts for it."""
    statistics = problem.statistics
    columns, coefficients, place = problem.mode_of(model)
    return float(
        (statistics.squares[place] - statistics.along[place, columns] @ coefficients)
        / statistics.freedom
    )


def mean_square(fitted: Fit) -> float:
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


def noise_beside(fitted: Fit, observations: Observations, pose_rad: float) -> Noise:
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


def remaining_noise(
    problem: Problem, model: Model, taken: Noise, least: Noise
) -> Noise:
    """Noise as a model leaves it.

    `taken`: by which the problem was whitened. `least`: that repeats or the campaign
    say, below which it does not fall.
    """
    left = mean_square_left(problem, model)
    factor = float(np.sqrt(max(left * (taken.position_m / least.position_m) ** 2, 1.0)))
    return replace(
        least.scaled(factor),
        pose_rad=float(np.sqrt(max(left, 1.0))) * model.pose_error_rad,
    )


@dataclass(frozen=True)
class Averaged:
    """Corrections to the exact fit of the most probable model.

    `shift` (str, str): by owner and name of a parameter: what the other models add to
    its estimate. `std_error` (str, str). `of_prior`: parameters of effects of which the
    prior says more than the measurements do.
    """

    shift: dict[tuple[str, str], float]
    std_error: dict[tuple[str, str], float]
    of_prior: frozenset[tuple[str, str]] = frozenset()


def averaged(
    linearized: Linearized,
    posterior: Posterior,
    best: Model,
    owners: Sequence[tuple[str, str]],
) -> Averaged:
    """Average over the models of a posterior.

    `best`: of which there is an exact fit. `owners` (str, str): owner and name of each
    parameter of the declared block.
    """
    likely = _likely(posterior, best)
    problem = linearized.problem
    sizes = {model.pose_error_rad for model, _ in likely}
    # Sizes of the pose error that the best model makes likely, and those of the models
    # that count.
    some = problem.statistics
    base = problem.statistics.log_likelihood + problem.log_pose
    if best.units:
        density = _joint(problem, best, some, base).by_pose_error
        of_models = np.isin(some.pose_error_rad, list(sizes))
        kept = np.flatnonzero((density > density.max() + UNLIKELY) | of_models)
        some = some.at(kept)
        base = base[kept]
    each = [
        (p, _moments(linearized, model, owners, _joint(problem, model, some, base)))
        for model, p in likely
    ]
    exact = next(
        found
        for (model, _), (_, found) in zip(likely, each, strict=True)
        if model is best
    )
    shift: dict[tuple[str, str], float] = {}
    std_error: dict[tuple[str, str], float] = {}
    for name, (estimate, _) in exact.items():
        weight, mean, variance = np.array(
            [
                (probability, *found[name])
                for probability, found in each
                if name in found
            ]
        ).T
        weight = weight / weight.sum()
        center = weight @ mean
        shift[name] = float(center - estimate)
        std_error[name] = float(np.sqrt(weight @ (variance + (mean - center) ** 2)))
    least = np.sqrt(problem.settings.prior_share)
    of_prior = frozenset(
        (unit.candidate.key, parameter.name)
        for unit in (problem.units[number] for number in best.units)
        if unit.candidate
        for parameter, size in zip(
            unit.candidate.parameters,
            unit.sizes * problem.grid.root_mean_square(unit),
            strict=True,
        )
        if std_error[unit.candidate.key, parameter.name] > least * size
    )
    return Averaged(shift, std_error, of_prior)


def expected_to_help(problem: Problem, posterior: Posterior, model: Model) -> bool:
    """Whether predictions are expected to be better with a model of the posterior than
    without it, at poses like the measured.

    With d the displacement that it predicts and E d its mean over all models, the
    expected square of the error falls by 2 d'E d - d'd where d is added. Under the
    model alone that has at most the variance 4 d'd of a least-squares estimate; the
    interval of the gain has to exclude nothing.
    """
    gram = problem.statistics.gram[0]
    mean = np.zeros(len(gram))
    mine = _predicted(problem, model)
    for other, probability in _likely(posterior, model):
        mean += probability * _predicted(problem, other)
    error = 2.0 * np.sqrt(
        mine @ gram @ mine * max(mean_square_left(problem, model), 1.0)
    )
    return bool(mine @ gram @ (2.0 * mean - mine) > problem.settings.useful * error)


def other_predictions(problem: Problem, posterior: Posterior, model: Model) -> float:
    """How otherwise the models of a posterior predict than one of them: expected sum of
    squares of whitened numbers.

    The smooth error of unknown cause is in no model that is kept, but the robot has it
    all the same.
    """
    gram = problem.statistics.gram[0]
    mine = _predicted(problem, model)
    for number in model.units:
        if problem.units[number].candidate is None:
            mine[problem.units[number].columns] = 0.0
    off = [
        (probability, _predicted(problem, other) - mine)
        for other, probability in _likely(posterior, model)
    ]
    return float(
        sum(probability * (apart @ gram @ apart) for probability, apart in off)
    )


def _likely(posterior: Posterior, best: Model) -> list[tuple[Model, float]]:
    """Models that count, and the best, with their probabilities."""
    pairs = zip(posterior.models, posterior.probabilities, strict=True)
    return [
        (model, probability)
        for model, probability in pairs
        if probability >= _LEAST_PROBABILITY or model is best
    ]


def squares_explained(problem: Problem, model: Model) -> dict[str, float]:
    """Sum of squares of the whitened displacements that each mechanism of a model
    makes, dict of str to float."""
    mechanisms = dict.fromkeys(
        problem.units[number].mechanism for number in model.units
    )
    return {
        mechanism: squares_beyond(problem, model, {mechanism})[0][0]
        for mechanism in mechanisms
    }


def squares_beyond(
    problem: Problem, model: Model, mechanisms: Collection[str]
) -> list[tuple[float, float]]:
    """Sum of squares of the displacements that some mechanisms of a model make, and how
    much of it the others cannot make.

    The others may take any size that their priors allow: a Schur complement of the Gram
    matrix with the priors of the others. Returns both numbers of these mechanisms, and
    then of the others.
    """
    coefficients = _predicted(problem, model)
    gram = problem.statistics.gram[0]
    columns, deviations = problem.columns_of(model.units, model.scales)
    units = [problem.units[number] for number in model.units]
    _, mine = problem.columns_of(
        model.units, [unit.mechanism in mechanisms for unit in units]
    )
    found = []
    for inside in (mine, ~mine):
        ours = columns[inside]
        rest = columns[~inside]
        made = gram[:, ours] @ coefficients[ours]
        whole = float(coefficients[ours] @ made[ours])
        inner = gram[np.ix_(rest, rest)] + np.diag(deviations[~inside] ** -2.0)
        found.append(
            (whole, whole - float(made[rest] @ solve_positive(inner, made[rest])))
        )
    return found


def _predicted(problem: Problem, model: Model) -> np.ndarray:
    """Coefficients of all columns in a model at its most probable sizes, in plausible
    sizes, ndarray (K,)."""
    coefficients = np.zeros(problem.statistics.gram.shape[1])
    columns, mode, _ = problem.mode_of(model)
    coefficients[columns] = mode
    return coefficients


def _moments(
    linearized: Linearized,
    model: Model,
    owners: Sequence[tuple[str, str]],
    joint: Joint,
) -> dict[tuple[str, str], tuple[float, float]]:
    """Mean and variance of every parameter of one model, by owner and name; declared
    ones up to a constant in the mean."""
    products = linearized.products
    problem = linearized.problem
    declared, (columns, deviations) = (
        products.declared,
        problem.columns_of(model.units, model.scales),
    )
    equations = normal_equations(products, model.pose_error_rad, columns)
    information = equations[:-1, :-1]
    places = np.arange(declared, len(equations) - 1)
    information[places, places] += deviations**-2.0
    # Declared parameters from the orthonormal basis, less what the candidates' columns
    # have in it.
    back = products.into_basis @ np.concatenate(
        [np.eye(declared), -products.projected[:, columns]], axis=1
    )
    solved = solve_positive(information, np.column_stack([back.T, equations[:-1, -1]]))
    variance = max(mean_square_left(problem, model), 1.0) * (
        back * solved[:, :-1].T
    ).sum(axis=1)
    found = dict(
        zip(owners, zip(back @ solved[:, -1], variance, strict=True), strict=True)
    )
    for number, (value, spread) in zip(model.units, joint.moments(), strict=True):
        unit = problem.units[number]
        if unit.candidate:
            names = [
                (unit.candidate.key, parameter.name)
                for parameter in unit.candidate.parameters
            ]
            found |= dict(
                zip(
                    names,
                    zip(unit.sizes * value, unit.sizes**2 * spread, strict=True),
                    strict=True,
                )
            )
    return found


def _joint(
    problem: Problem, model: Model, statistics: Statistics, base: np.ndarray
) -> Joint:
    """Density under a model, at some sizes of the pose error with what each contributes
    alone."""
    places = np.searchsorted(problem.grid.scales, model.scales)
    units = [problem.units[number] for number in model.units]
    return Joint(statistics, units, problem.grid, base, places)
