"""Parameters and predictions averaged over the models of a posterior, so that intervals
are honest after selection.

What other models say differently is taken from the linearised problem by Bayesian model
averaging [1]_: the mean over models shifts the estimate, and their spread widens its
standard error (law of total variance). Parameters of an effect are averaged over its
sizes and over the models that have it: they state how large it is if it is present.

References
----------
.. [1] Hoeting, Madigan, Raftery and Volinsky, Statistical Science 14, 1999.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from elastocal.diagnosis.evidence import ModelDensity
from elastocal.diagnosis.refit import predict_reduced_chi_square
from elastocal.diagnosis.search import NEGLIGIBLE_LOG_WEIGHT, solve_positive_definite
from elastocal.diagnosis.statistics import assemble_normal_equations

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.search import Posterior, ScoredModel, SearchProblem
    from elastocal.diagnosis.statistics import SufficientStatistics

    # Owner and name of a parameter.
    ParameterKey = tuple[str, str]
    # Mean and variance of each parameter.
    Moments = dict[ParameterKey, tuple[float, float]]

# Models that are less probable change no reported digit of an average.
_MIN_PROBABILITY = 0.002


@dataclass(frozen=True)
class ModelAverage:
    """Corrections to the exact fit of the most probable model, by owner and name of
    each parameter.

    Attributes
    ----------
    shift
        What the other models add to its estimate.
    std_error
        Standard error over all models.
    prior_dominated
        Parameters of effects about which the prior says more than the measurements.
    """

    shift: dict[ParameterKey, float]
    std_error: dict[ParameterKey, float]
    prior_dominated: frozenset[ParameterKey] = frozenset()


class SumOfSquares(NamedTuple):
    """Sum of squares of the whitened displacements that some terms of a model make.

    Attributes
    ----------
    total
        The whole sum.
    extra
        The part that the other terms of the model cannot make.
    """

    total: float
    extra: float


class PredictedGain(NamedTuple):
    """Expected gain of a model over the declared one.

    Attributes
    ----------
    share
        What squared errors fall by, as a share of the squared displacements that the
        model adds: one if the model is certain, negative if it is probably wrong.
    std_error
        Standard error of the share.
    squares
        Sum of squares of the whitened displacements.
    """

    share: float
    std_error: float
    squares: float


def average_models(
    design: CandidateDesign,
    posterior: Posterior,
    best: ScoredModel,
    declared_parameters: Sequence[ParameterKey],
) -> ModelAverage:
    """Average the parameters over the models of a posterior.

    Parameters
    ----------
    design
        The linearised problem.
    posterior
        Models and their probabilities.
    best
        The model of which there is an exact fit.
    declared_parameters
        Owner and name of each parameter of the declared model, in its order.
    """
    problem = design.problem
    models = _select_likely_models(posterior, best)
    statistics, log_weights = _select_pose_errors(problem, best, models)
    weighted_moments = []
    best_moments: Moments = {}
    for model, probability in models:
        density = _build_density(problem, model, statistics, log_weights)
        moments = _compute_moments(design, model, declared_parameters, density)
        weighted_moments.append((probability, moments))
        if model is best:
            best_moments = moments
    shift = {}
    std_error = {}
    for key, (estimate, _) in best_moments.items():
        mean, variance = _mix_moments(weighted_moments, key)
        shift[key] = float(mean - estimate)
        std_error[key] = float(np.sqrt(variance))
    prior_dominated = _find_prior_dominated(problem, best, std_error)
    return ModelAverage(shift, std_error, prior_dominated)


def _mix_moments(
    weighted_moments: Sequence[tuple[float, Moments]], key: ParameterKey
) -> tuple[float, float]:
    """Mean and variance of a parameter over the models that contain it, each with the
    probability of the model."""
    probability, mean, variance = np.array(
        [
            (probability, *moments[key])
            for probability, moments in weighted_moments
            if key in moments
        ]
    ).T
    weight = probability / probability.sum()
    average = weight @ mean
    return average, weight @ (variance + (mean - average) ** 2)


def allow_for_laws(
    problem: SearchProblem, model: ScoredModel, average: ModelAverage, poses: int
) -> ModelAverage:
    """Widen the standard errors of effects whose laws are only nearly true.

    A machine departs from a law by the tolerance t of the displacements. Their whitened
    squares S are shared by the poses, and so is the departure, which all measurements of
    a pose have in common. It adds t^2 S / poses to the variance of each pose, which is
    one: a model discrepancy [1]_ as large as the law is uncertain, and negligible for an
    effect that is barely seen.

    References
    ----------
    .. [1] Brynjarsdóttir, J. and O'Hagan, A., Learning about physical parameters: the
       importance of model discrepancy, Inverse Problems 30, 2014.
    """
    squares = compute_explained_squares(problem, model)
    tolerance = problem.settings.law_tolerance**2
    std_error = dict(average.std_error)
    for index in model.term_indices:
        term = problem.terms[index]
        if term.candidate is None:
            continue
        factor = np.sqrt(1.0 + tolerance * squares[term.mechanism] / poses)
        for parameter in term.candidate.parameters:
            key = (term.candidate.key, parameter.name)
            std_error[key] = float(factor * average.std_error[key])
    return replace(average, std_error=std_error)


def _find_prior_dominated(
    problem: SearchProblem, model: ScoredModel, std_error: dict[ParameterKey, float]
) -> frozenset[ParameterKey]:
    """Parameters of a model's effects of whose prior variance more than `prior_share`
    is left after the measurements."""
    max_ratio = np.sqrt(problem.settings.prior_share)
    keys = set()
    for index in model.term_indices:
        term = problem.terms[index]
        if term.candidate is None:
            continue
        prior_std = term.sizes * problem.grid.root_mean_square(term)
        for parameter, deviation in zip(
            term.candidate.parameters, prior_std, strict=True
        ):
            key = (term.candidate.key, parameter.name)
            if std_error[key] > max_ratio * deviation:
                keys.add(key)
    return frozenset(keys)


def is_expected_to_help(
    problem: SearchProblem, posterior: Posterior, model: ScoredModel
) -> bool:
    """Decide whether a model is expected to predict better than the declared one, at
    poses like those measured: the interval of the gain has to exclude zero."""
    gain = predict_gain(problem, posterior, model)
    return bool(gain.share > problem.settings.useful * gain.std_error)


def predict_gain(
    problem: SearchProblem, posterior: Posterior, model: ScoredModel
) -> PredictedGain:
    """Predict by how much a model lowers squared errors, at poses like those measured.

    With d the displacement that the model predicts and E d its mean over all models,
    adding d lowers the expected squared error by 2 d'E d - d'd. Under the model alone
    that gain has at most the variance 4 d'd of a least-squares estimate.
    """
    gram = problem.statistics.gram[0]
    coefficients = _compute_coefficients(problem, model)
    mean = np.zeros(len(gram))
    for likely_model, probability in _select_likely_models(posterior, model):
        mean += probability * _compute_coefficients(problem, likely_model)
    variance_factor = max(predict_reduced_chi_square(problem, model), 1.0)
    squares = float(coefficients @ gram @ coefficients)
    if squares <= 0.0:
        return PredictedGain(0.0, np.inf, 0.0)
    share = coefficients @ gram @ (2.0 * mean - coefficients) / squares
    std_error = 2.0 * np.sqrt(variance_factor / squares)
    return PredictedGain(float(share), float(std_error), squares)


def compute_between_model_squares(
    problem: SearchProblem, posterior: Posterior, model: ScoredModel
) -> float:
    """Compute how differently the models of a posterior predict from one of them.

    The discrepancy term, a smooth error of unknown cause, is in no model that is kept,
    but the robot has that error all the same: it counts as a difference.

    Returns
    -------
    float
        Expected sum of squares of the differences of the whitened predictions.
    """
    gram = problem.statistics.gram[0]
    coefficients = _compute_coefficients(problem, model)
    for index in model.term_indices:
        term = problem.terms[index]
        if term.candidate is None:
            coefficients[term.columns] = 0.0
    squares = 0.0
    for likely_model, probability in _select_likely_models(posterior, model):
        difference = _compute_coefficients(problem, likely_model) - coefficients
        squares += probability * (difference @ gram @ difference)
    # The Gram matrix has eigenvalues that are negative by rounding. Without this bound,
    # equal models would have a root mean square that is not a number.
    return max(float(squares), 0.0)


def compute_explained_squares(
    problem: SearchProblem, model: ScoredModel
) -> dict[str, float]:
    """Compute the sum of squares of the whitened displacements that each mechanism of a
    model makes, by mechanism."""
    mechanisms = dict.fromkeys(
        problem.terms[index].mechanism for index in model.term_indices
    )
    return {
        mechanism: compute_extra_squares(problem, model, {mechanism})[0].total
        for mechanism in mechanisms
    }


def compute_extra_squares(
    problem: SearchProblem, model: ScoredModel, mechanisms: Collection[str]
) -> tuple[SumOfSquares, SumOfSquares]:
    """Compute the sums of squares of some mechanisms of a model and of the others, each
    with its extra part, which the other group cannot make.

    The other group may take any sizes that its priors allow: the extra sum of squares
    [1]_ is a Schur complement of the Gram matrix with the priors of the other group.

    Parameters
    ----------
    problem
        The linearised problem.
    model
        One of its models.
    mechanisms
        Names of mechanisms of the model.

    Returns
    -------
    SumOfSquares, SumOfSquares
        Of these mechanisms, and of all others.

    References
    ----------
    .. [1] Draper and Smith, Applied Regression Analysis, 1998, section 6.1.
    """
    coefficients = _compute_coefficients(problem, model)
    gram = problem.statistics.gram[0]
    columns, prior_std = problem.scaled_columns(model.term_indices, model.scales)
    _, in_group = problem.scaled_columns(
        model.term_indices,
        [problem.terms[index].mechanism in mechanisms for index in model.term_indices],
    )

    def split(inside: np.ndarray) -> SumOfSquares:
        group = columns[inside]
        complement = columns[~inside]
        products = gram[:, group] @ coefficients[group]
        total = float(coefficients[group] @ products[group])
        penalized = gram[np.ix_(complement, complement)] + np.diag(
            prior_std[~inside] ** -2.0
        )
        solution = solve_positive_definite(penalized, products[complement])
        return SumOfSquares(total, total - float(products[complement] @ solution))

    return split(in_group), split(~in_group)


def _select_likely_models(
    posterior: Posterior, best: ScoredModel
) -> list[tuple[ScoredModel, float]]:
    """The probable models of a posterior, and the best one, with their
    probabilities."""
    pairs = zip(posterior.models, posterior.probabilities, strict=True)
    return [
        (model, probability)
        for model, probability in pairs
        if probability >= _MIN_PROBABILITY or model is best
    ]


def _compute_coefficients(problem: SearchProblem, model: ScoredModel) -> np.ndarray:
    """Coefficients of all columns in a model at its most probable sizes, (K,), in
    plausible sizes."""
    coefficients = np.zeros(problem.statistics.gram.shape[1])
    columns, mode, _ = problem.find_mode(model)
    coefficients[columns] = mode
    return coefficients


def _select_pose_errors(
    problem: SearchProblem,
    best: ScoredModel,
    models: list[tuple[ScoredModel, float]],
) -> tuple[SufficientStatistics, np.ndarray]:
    """Select the statistics at the pose errors that the best model makes likely and at
    those of the other models; returns them with the log weight of each, (T,)."""
    statistics = problem.statistics
    log_weights = statistics.log_likelihood + problem.log_pose
    if not best.term_indices:
        return statistics, log_weights
    density = _build_density(problem, best, statistics, log_weights).by_pose_error
    likely = density > density.max() + NEGLIGIBLE_LOG_WEIGHT
    sizes = list({model.pose_error_rad for model, _ in models})
    chosen = np.flatnonzero(likely | np.isin(statistics.pose_error_rad, sizes))
    return statistics.at(chosen), log_weights[chosen]


def _compute_moments(
    design: CandidateDesign,
    model: ScoredModel,
    declared_parameters: Sequence[ParameterKey],
    density: ModelDensity,
) -> Moments:
    """Mean and variance of every parameter of one model; means of the declared
    parameters up to a constant."""
    problem = design.problem
    moments = _compute_declared_moments(design, model, declared_parameters)
    for index, (mean, variance) in zip(
        model.term_indices, density.moments(), strict=True
    ):
        term = problem.terms[index]
        if term.candidate is None:
            continue
        for parameter, size, parameter_mean, parameter_variance in zip(
            term.candidate.parameters, term.sizes, mean, variance, strict=True
        ):
            moments[term.candidate.key, parameter.name] = (
                size * parameter_mean,
                size**2 * parameter_variance,
            )
    return moments


def _compute_declared_moments(
    design: CandidateDesign,
    model: ScoredModel,
    declared_parameters: Sequence[ParameterKey],
) -> Moments:
    """Mean, up to a constant, and variance of every declared parameter in one model."""
    problem = design.problem
    products = design.products
    count = products.declared_count
    columns, prior_std = problem.scaled_columns(model.term_indices, model.scales)
    equations = assemble_normal_equations(products, model.pose_error_rad, columns)
    information = equations[:-1, :-1]
    candidates = np.arange(count, len(equations) - 1)
    information[candidates, candidates] += prior_std**-2.0
    # Transform from the orthonormal basis back to the declared parameters, without the
    # part of the candidates' columns that lies in the basis.
    transform = products.basis_transform @ np.concatenate(
        [np.eye(count), -products.projections[:, columns]], axis=1
    )
    solution = solve_positive_definite(
        information, np.column_stack([transform.T, equations[:-1, -1]])
    )
    mean = transform @ solution[:, -1]
    variance_factor = max(predict_reduced_chi_square(problem, model), 1.0)
    variance = variance_factor * (transform * solution[:, :-1].T).sum(axis=1)
    return dict(zip(declared_parameters, zip(mean, variance, strict=True), strict=True))


def _build_density(
    problem: SearchProblem,
    model: ScoredModel,
    statistics: SufficientStatistics,
    log_weights: np.ndarray,
) -> ModelDensity:
    """Density of the measurements under a model, at pose errors with log weights
    (T,)."""
    sizes = np.searchsorted(problem.grid.scales, model.scales)
    terms = [problem.terms[index] for index in model.term_indices]
    return ModelDensity(statistics, terms, problem.grid, log_weights, sizes)
