"""Averages over models agree with dense calculations of the same quantities."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_problems import make_problem, make_rows, make_term
from scipy.optimize import minimize

from elastocal.diagnosis.evidence import ModelDensity
from elastocal.diagnosis.model_averaging import (
    ModelAverage,
    allow_for_laws,
    average_models,
    compute_between_model_squares,
    compute_explained_squares,
    compute_extra_squares,
    is_expected_to_help,
)
from elastocal.diagnosis.search import Posterior, ScoredModel

# Sizes of the pose error, rad.
TAU = np.array([0.0, 0.3, 0.9])
DECLARED_COUNT = 4
DECLARED_PARAMETERS = [("declared", str(number)) for number in range(DECLARED_COUNT)]


def make_candidate(key, count):
    parameters = [SimpleNamespace(name=str(number)) for number in range(count)]
    return SimpleNamespace(key=key, parameters=parameters)


TERMS = (
    make_term("a", (1,), [0, 1], candidate=make_candidate("a", 2)),
    make_term("b", (1,), 2, candidate=make_candidate("b", 1)),
    make_term("other", (1,), [3, 4]),
)


@pytest.fixture(scope="module")
def rows_and_design():
    """Rows with little noise and a contribution of each term, so that the estimated
    size of the noise is at its lower bound; and their linearised problem."""
    rows = make_rows(1, poses=12)
    noise = 0.5 * (rows.residual - rows.expected)
    contribution = rows.candidates @ [0.2, -0.1, 0.2, 0.1, 0.0, 0.0]
    rows = replace(rows, residual=rows.expected + noise + contribution)
    problem, products = make_problem(rows, TERMS, tau=TAU)
    return rows, SimpleNamespace(problem=problem, products=products)


def make_posterior(*entries):
    """A posterior of models: term indices, scales, pose error and probability of each."""
    models = tuple(
        ScoredModel(term_indices, 0.0, np.array(scales, float), pose_error_rad)
        for term_indices, scales, pose_error_rad, _ in entries
    )
    return Posterior(models, np.array([probability for *_, probability in entries]))


def select_columns(model):
    """Columns of a model's terms, and the prior standard deviation of each."""
    columns = [TERMS[index].columns for index in model.term_indices]
    widths = [len(of_term) for of_term in columns]
    return np.concatenate([np.zeros(0, int), *columns]), np.repeat(model.scales, widths)


def solve_regression(rows, tau, columns, prior_std):
    """Mean and covariance of the declared parameters, counted from their present
    values, and of the coefficients of some columns: Bayes' rule, dense."""
    design = np.column_stack([rows.declared, rows.candidates[:, columns]])
    variance = np.concatenate([rows.prior_std, prior_std]) ** 2
    center = np.concatenate([-rows.present, np.zeros(len(columns))])
    covariance = rows.covariance(tau) + (design * variance) @ design.T
    gain = variance[:, None] * np.linalg.solve(covariance, design).T
    mean = center + gain @ (rows.residual - design @ center)
    return mean, np.diag(variance) - gain @ design * variance


def compute_log_density(rows, tau, scaled_columns):
    """Log density of the rows under a model, dense, up to a constant."""
    covariance = rows.marginal_covariance(tau) + scaled_columns @ scaled_columns.T
    deviation = rows.residual - rows.expected
    squares = deviation @ np.linalg.solve(covariance, deviation)
    return -0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * squares


def average(weights, means, variances):
    """Mean and variance of a mixture of distributions with some weights."""
    weights = np.asarray(weights)[:, None]
    means = np.array(means)
    center = (weights * means).sum(axis=0)
    return center, (weights * (np.array(variances) + (means - center) ** 2)).sum(axis=0)


def test_moments_of_a_term_are_averaged_over_its_scales_and_the_pose_error(
    rows_and_design,
):
    rows, design = rows_and_design
    problem = design.problem
    term = TERMS[0]
    base = problem.statistics.log_likelihood + problem.log_pose
    density = ModelDensity(
        problem.statistics, [term], problem.grid, base, np.array([2])
    )
    ((mean, variance),) = density.moments()
    log_weights = []
    means = []
    variances = []
    for tau, log_pose in zip(TAU, problem.log_pose, strict=True):
        for scale, log_prior in zip(
            problem.grid.scales, problem.grid.log_weights, strict=True
        ):
            log_density = compute_log_density(
                rows, tau, scale * rows.candidates[:, term.columns]
            )
            log_weights.append(log_density + log_pose + log_prior)
            moments = solve_regression(rows, tau, term.columns, np.full(2, scale))
            means.append(moments[0][DECLARED_COUNT:])
            variances.append(np.diag(moments[1])[DECLARED_COUNT:])
    weights = np.exp(np.array(log_weights) - max(log_weights))
    expected = average(weights / weights.sum(), means, variances)
    np.testing.assert_allclose(mean, expected[0], rtol=1e-8)
    np.testing.assert_allclose(variance, expected[1], rtol=1e-8)


def test_declared_parameters_are_averaged_over_all_models(rows_and_design):
    rows, design = rows_and_design
    posterior = make_posterior(
        ((0,), [0.3], 0.0, 0.6), ((), [], 0.3, 0.3), ((1, 2), [1.0, 0.1], 0.9, 0.1)
    )
    averages = average_models(
        design, posterior, posterior.models[0], DECLARED_PARAMETERS
    )
    means = []
    variances = []
    for model in posterior.models:
        mean, covariance = solve_regression(
            rows, model.pose_error_rad, *select_columns(model)
        )
        means.append(mean[:DECLARED_COUNT])
        variances.append(np.diag(covariance)[:DECLARED_COUNT])
    center, variance = average(posterior.probabilities, means, variances)
    np.testing.assert_allclose(
        [averages.shift[key] for key in DECLARED_PARAMETERS],
        center - means[0],
        rtol=1e-6,
        atol=1e-9,
    )
    np.testing.assert_allclose(
        [averages.std_error[key] for key in DECLARED_PARAMETERS],
        np.sqrt(variance),
        rtol=1e-6,
    )


def test_coefficients_are_averaged_over_the_models_that_contain_them(rows_and_design):
    """An average states how large an effect is if it is present: models without the
    effect do not pull it to zero."""
    _, design = rows_and_design

    def average_about(posterior, index=0):
        model = posterior.models[index]
        return average_models(design, posterior, model, DECLARED_PARAMETERS)

    best = ((0,), [0.3], 0.0, 0.5)
    alone = average_about(make_posterior(best))
    with_empty_model = average_about(make_posterior(best, ((), [], 0.0, 0.5)))
    for name in ("0", "1"):
        key = ("a", name)
        assert with_empty_model.shift[key] == pytest.approx(alone.shift[key])
        assert alone.shift[key] == pytest.approx(0.0, abs=1e-12)
        assert with_empty_model.std_error[key] == pytest.approx(alone.std_error[key])
    # In a model with another term the effect may have another size.
    posterior = make_posterior(best, ((0, 1), [0.3, 1.0], 0.0, 0.5))
    with_larger_model = average_about(posterior)
    assert abs(with_larger_model.shift["a", "0"]) > 1e-3
    # Neither effects that the most probable model lacks nor the discrepancy are
    # reported.
    owners = {owner for owner, _ in with_larger_model.shift}
    assert owners == {"declared", "a"}
    owners = {owner for owner, _ in average_about(posterior, 1).shift}
    assert owners == {"declared", "a", "b"}


def find_mode(rows, problem, model):
    """Most probable coefficients (K,) of a model, dense: at its scales, and at the pose
    error that is then most probable."""
    columns, prior_std = select_columns(model)
    scaled_columns = rows.candidates[:, columns] * prior_std
    log_densities = [
        log_pose + compute_log_density(rows, tau, scaled_columns)
        for tau, log_pose in zip(TAU, problem.log_pose, strict=True)
    ]
    tau = TAU[int(np.argmax(log_densities))]
    coefficients = np.zeros(rows.candidates.shape[1])
    mean, _ = solve_regression(rows, tau, columns, prior_std)
    coefficients[columns] = mean[DECLARED_COUNT:]
    return coefficients


def project_gram(rows):
    """Gram matrix of the candidates without the part that declared parameters explain,
    without a pose error, dense."""
    return rows.candidates.T @ np.linalg.solve(
        rows.marginal_covariance(0.0), rows.candidates
    )


@pytest.mark.parametrize("competitor", [(), (1,), (1, 2), (0, 1)])
@pytest.mark.parametrize("probability", [0.25, 0.45, 0.55, 0.9])
def test_a_model_is_expected_to_help_if_it_lowers_the_expected_squared_error(
    rows_and_design, probability, competitor
):
    """A model that predicts the same as its competitors helps, however improbable it is
    by itself."""
    rows, design = rows_and_design
    settings = replace(design.problem.settings, useful=0.0)
    problem = replace(design.problem, settings=settings)
    posterior = make_posterior(
        ((0,), [0.3], 0.0, probability),
        (competitor, [0.3] * len(competitor), 0.0, 1 - probability),
    )
    gram = project_gram(rows)
    modes = [find_mode(rows, problem, model) for model in posterior.models]

    def expect_squared_error(kept):
        first = (modes[0] - kept) @ gram @ (modes[0] - kept)
        second = (modes[1] - kept) @ gram @ (modes[1] - kept)
        return probability * first + (1 - probability) * second

    helps = expect_squared_error(modes[0]) < expect_squared_error(np.zeros(len(gram)))
    assert is_expected_to_help(problem, posterior, posterior.models[0]) == helps


def test_squares_between_models_are_not_negative_by_rounding(rows_and_design):
    problem = rows_and_design[1].problem
    posterior = make_posterior(((0,), [0.3], 0.0, 0.6), ((0, 1), [0.3] * 2, 0.0, 0.4))
    gram = problem.statistics.gram
    rounded = replace(problem.statistics, gram=gram * -1e-16)
    squares = compute_between_model_squares(
        replace(problem, statistics=rounded), posterior, posterior.models[0]
    )
    assert squares == 0.0


def test_the_extra_sum_of_squares_is_the_least_penalised_sum_that_the_other_terms_leave(
    rows_and_design,
):
    """A numerical search finds the same minimum. Without other terms in the model, the
    extra sum of squares is the whole sum."""
    rows, _ = rows_and_design
    problem, _ = make_problem(rows, TERMS, tau=TAU)
    model = ScoredModel((0, 2), 0.0, np.array([0.3, 0.1]), 0.0)
    coefficients = find_mode(rows, problem, model)
    gram = project_gram(rows)
    effect_columns = TERMS[0].columns
    other_columns = TERMS[2].columns

    def compute_penalised_squares(values):
        difference = np.zeros(len(coefficients))
        difference[effect_columns] = coefficients[effect_columns]
        difference[other_columns] = -values
        return difference @ gram @ difference + (values**2).sum() / 0.1**2

    total, extra = compute_extra_squares(problem, model, {"a"})[0]
    explained = compute_explained_squares(problem, model)["a"]
    assert total == pytest.approx(explained, rel=1e-6)
    least = minimize(compute_penalised_squares, np.zeros(len(other_columns))).fun
    assert extra == pytest.approx(least, rel=1e-6)
    assert 0.0 < extra < total
    alone = ScoredModel((0,), 0.0, np.array([0.3]), 0.0)
    explained = compute_explained_squares(problem, alone)["a"]
    extra = compute_extra_squares(problem, alone, {"a"})[0].extra
    assert extra == pytest.approx(explained)


@pytest.mark.parametrize("poses", [4, 400])
def test_intervals_widen_with_the_squares_by_which_a_law_may_be_off(
    rows_and_design, poses
):
    """The departure adds to the variance of each pose, which noise alone makes one."""
    problem = rows_and_design[1].problem
    model = ScoredModel((0, 1, 2), 0.0, np.array([1.0, 0.3, 1.0]), 0.0)
    std_error = {
        ("a", "0"): 2.0,
        ("a", "1"): 3.0,
        ("b", "0"): 5.0,
        DECLARED_PARAMETERS[0]: 7.0,
    }
    widened = allow_for_laws(problem, model, ModelAverage({}, std_error), poses)
    squares = compute_explained_squares(problem, model)
    tolerance = problem.settings.law_tolerance**2
    variance = {name: 1.0 + tolerance * squares[name] / poses for name in "ab"}
    assert widened.std_error == pytest.approx(
        {
            ("a", "0"): 2.0 * np.sqrt(variance["a"]),
            ("a", "1"): 3.0 * np.sqrt(variance["a"]),
            ("b", "0"): 5.0 * np.sqrt(variance["b"]),
            DECLARED_PARAMETERS[0]: 7.0,
        }
    )
    assert variance["a"] > 1.0
