"""Averages over the models of a posterior."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.diagnosis.evidence import ModelDensity
from elastocal.diagnosis.refit import predict_reduced_chi_square
from elastocal.diagnosis.search import (
    NEGLIGIBLE_LOG_WEIGHT,
    Posterior,
    ScoredModel,
    SearchProblem,
    solve_positive_definite,
)
from elastocal.diagnosis.statistics import (
    SufficientStatistics,
    assemble_normal_equations,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.effects.protocol import Candidate

    # Effects with normal priors on their parameters, and values of their shapes.
    SelectedEffects = tuple[tuple[Candidate, np.ndarray], ...]

# Models that hold less than this move no digit that is reported.
_LEAST_PROBABILITY = 0.002


@dataclass(frozen=True)
class ModelAverage:
    """Corrections to the exact fit of the most probable model.

    `shift` (str, str): by owner and name of a parameter: what the other models add to
    its estimate. `std_error` (str, str). `of_prior`: parameters of effects of which the
    prior says more than the measurements do.
    """

    shift: dict[tuple[str, str], float]
    std_error: dict[tuple[str, str], float]
    prior_dominated: frozenset[tuple[str, str]] = frozenset()


def average_models(
    linearized: CandidateDesign,
    posterior: Posterior,
    best: ScoredModel,
    owners: Sequence[tuple[str, str]],
) -> ModelAverage:
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
    if best.term_indices:
        density = _joint(problem, best, some, base).by_pose_error
        of_models = np.isin(some.pose_error_rad, list(sizes))
        kept = np.flatnonzero(
            (density > density.max() + NEGLIGIBLE_LOG_WEIGHT) | of_models
        )
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
        for unit in (problem.terms[number] for number in best.term_indices)
        if unit.candidate
        for parameter, size in zip(
            unit.candidate.parameters,
            unit.sizes * problem.grid.root_mean_square(unit),
            strict=True,
        )
        if std_error[unit.candidate.key, parameter.name] > least * size
    )
    return ModelAverage(shift, std_error, of_prior)


def is_expected_to_help(
    problem: SearchProblem, posterior: Posterior, model: ScoredModel
) -> bool:
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
        mine @ gram @ mine * max(predict_reduced_chi_square(problem, model), 1.0)
    )
    return bool(mine @ gram @ (2.0 * mean - mine) > problem.settings.useful * error)


def compute_between_model_squares(
    problem: SearchProblem, posterior: Posterior, model: ScoredModel
) -> float:
    """How otherwise the models of a posterior predict than one of them: expected sum of
    squares of whitened numbers.

    The smooth error of unknown cause is in no model that is kept, but the robot has it
    all the same.
    """
    gram = problem.statistics.gram[0]
    mine = _predicted(problem, model)
    for number in model.term_indices:
        if problem.terms[number].candidate is None:
            mine[problem.terms[number].columns] = 0.0
    off = [
        (probability, _predicted(problem, other) - mine)
        for other, probability in _likely(posterior, model)
    ]
    return float(
        sum(probability * (apart @ gram @ apart) for probability, apart in off)
    )


def _likely(posterior: Posterior, best: ScoredModel) -> list[tuple[ScoredModel, float]]:
    """Models that count, and the best, with their probabilities."""
    pairs = zip(posterior.models, posterior.probabilities, strict=True)
    return [
        (model, probability)
        for model, probability in pairs
        if probability >= _LEAST_PROBABILITY or model is best
    ]


def compute_explained_squares(
    problem: SearchProblem, model: ScoredModel
) -> dict[str, float]:
    """Sum of squares of the whitened displacements that each mechanism of a model
    makes, dict of str to float."""
    mechanisms = dict.fromkeys(
        problem.terms[number].mechanism for number in model.term_indices
    )
    return {
        mechanism: compute_extra_squares(problem, model, {mechanism})[0][0]
        for mechanism in mechanisms
    }


def compute_extra_squares(
    problem: SearchProblem, model: ScoredModel, mechanisms: Collection[str]
) -> list[tuple[float, float]]:
    """Sum of squares of the displacements that some mechanisms of a model make, and how
    much of it the others cannot make.

    The others may take any size that their priors allow: a Schur complement of the Gram
    matrix with the priors of the others. Returns both numbers of these mechanisms, and
    then of the others.
    """
    coefficients = _predicted(problem, model)
    gram = problem.statistics.gram[0]
    columns, deviations = problem.scaled_columns(model.term_indices, model.scales)
    units = [problem.terms[number] for number in model.term_indices]
    _, mine = problem.scaled_columns(
        model.term_indices, [unit.mechanism in mechanisms for unit in units]
    )
    found = []
    for inside in (mine, ~mine):
        ours = columns[inside]
        rest = columns[~inside]
        made = gram[:, ours] @ coefficients[ours]
        whole = float(coefficients[ours] @ made[ours])
        inner = gram[np.ix_(rest, rest)] + np.diag(deviations[~inside] ** -2.0)
        found.append(
            (
                whole,
                whole - float(made[rest] @ solve_positive_definite(inner, made[rest])),
            )
        )
    return found


def _predicted(problem: SearchProblem, model: ScoredModel) -> np.ndarray:
    """Coefficients of all columns in a model at its most probable sizes, in plausible
    sizes, ndarray (K,)."""
    coefficients = np.zeros(problem.statistics.gram.shape[1])
    columns, mode, _ = problem.find_mode(model)
    coefficients[columns] = mode
    return coefficients


def _moments(
    linearized: CandidateDesign,
    model: ScoredModel,
    owners: Sequence[tuple[str, str]],
    joint: ModelDensity,
) -> dict[tuple[str, str], tuple[float, float]]:
    """Mean and variance of every parameter of one model, by owner and name; declared
    ones up to a constant in the mean."""
    products = linearized.products
    problem = linearized.problem
    declared, (columns, deviations) = (
        products.declared_count,
        problem.scaled_columns(model.term_indices, model.scales),
    )
    equations = assemble_normal_equations(products, model.pose_error_rad, columns)
    information = equations[:-1, :-1]
    places = np.arange(declared, len(equations) - 1)
    information[places, places] += deviations**-2.0
    # Declared parameters from the orthonormal basis, less what the candidates' columns
    # have in it.
    back = products.basis_transform @ np.concatenate(
        [np.eye(declared), -products.projections[:, columns]], axis=1
    )
    solved = solve_positive_definite(
        information, np.column_stack([back.T, equations[:-1, -1]])
    )
    variance = max(predict_reduced_chi_square(problem, model), 1.0) * (
        back * solved[:, :-1].T
    ).sum(axis=1)
    found = dict(
        zip(owners, zip(back @ solved[:, -1], variance, strict=True), strict=True)
    )
    for number, (value, spread) in zip(
        model.term_indices, joint.moments(), strict=True
    ):
        unit = problem.terms[number]
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
    problem: SearchProblem,
    model: ScoredModel,
    statistics: SufficientStatistics,
    base: np.ndarray,
) -> ModelDensity:
    """Density under a model, at some sizes of the pose error with what each contributes
    alone."""
    places = np.searchsorted(problem.grid.scales, model.scales)
    units = [problem.terms[number] for number in model.term_indices]
    return ModelDensity(statistics, units, problem.grid, base, places)
