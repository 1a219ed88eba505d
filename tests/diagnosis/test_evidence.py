"""Bayes factors are ratios of marginal likelihoods, integrated by brute force."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import make_rows, make_term
from scipy.integrate import dblquad, quad
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from elastocal.diagnosis.evidence import (
    ModelDensity,
    SizeGrid,
    compute_pose_error_log_prior,
    evaluate_model,
    list_pose_errors,
    log_likelihood,
)
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.statistics import compute_statistics

TAU = np.array([0.0, 0.3, 0.9])
SETTINGS = Settings()
GRID = SizeGrid.from_settings(SETTINGS)
LOG_POSE = compute_pose_error_log_prior(TAU, SETTINGS)
# Residuals of this share of the noise: its size is then at its lower bound, and all
# densities are normal.
QUIET = 0.5
TERMS = (
    make_term("a", (1,), [0, 1]),
    make_term("b", (1,), 2),
    make_term("c", (1,), [3, 4, 5]),
)


def quiet_rows(seed, signal=()):
    """Rows with less noise than declared, and a signal of some candidates."""
    rows = make_rows(seed, poses=12)
    signal = np.array([*signal, *np.zeros(rows.candidates.shape[1] - len(signal))])
    noise = QUIET * (rows.residual - rows.expected)
    return replace(rows, residual=rows.expected + noise + rows.candidates @ signal)


def grid_of_one(scale):
    return SizeGrid(np.array([scale]), np.zeros(1))


def log_density(rows, tau, deviations):
    """ln N(y; X mu, V(tau) + W D W') by scipy, with all constants."""
    covariance = (
        rows.marginal_covariance(tau)
        + (rows.candidates * deviations**2) @ rows.candidates.T
    )
    return multivariate_normal(rows.expected, covariance).logpdf(rows.residual)


def average_over_pose_errors(rows, deviations):
    """Log density averaged over the pose error."""
    by_pose_error = [
        log_prior + log_density(rows, tau, deviations)
        for tau, log_prior in zip(TAU, LOG_POSE, strict=True)
    ]
    return logsumexp(by_pose_error)


def brute_log_bayes_factor(rows, terms, grid=GRID):
    """Sum over all combinations of scales and of the pose error."""
    by_scales = []
    for indices in np.ndindex(*[len(grid.scales)] * len(terms)):
        deviations = np.zeros(6)
        for index, term in zip(indices, terms, strict=True):
            deviations[term.columns] = grid.scales[index]
        log_weight = grid.log_weights[list(indices)].sum()
        by_scales.append(log_weight + average_over_pose_errors(rows, deviations))
    return logsumexp(by_scales) - average_over_pose_errors(rows, np.zeros(6))


def evaluate(rows, terms, start=None):
    statistics = compute_statistics(rows.products, TAU)
    start = [SETTINGS.scale_center] * len(terms) if start is None else start
    return evaluate_model(statistics, terms, GRID, LOG_POSE, start)


def log_bayes_factor(rows, terms):
    return evaluate(rows, terms).log_evidence - evaluate(rows, ()).log_evidence


SIGNALS = {
    "nothing": (),
    "a": (0.4, -0.3),
    "b": (0, 0, 0.5),
    "a little of all": (0.1, 0.1, -0.1, 0.1, 0.0, 0.1),
}


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("chosen", [(0,), (1,), (2,), (0, 1), (0, 1, 2)])
def test_evidence_is_that_of_all_combinations_of_scales(signal, chosen):
    """Exactly for one term; for several to 0.03 nats, because their scales are not
    quite independent given the measurements."""
    rows = quiet_rows(3, SIGNALS[signal])
    terms = [TERMS[number] for number in chosen]
    statistics = compute_statistics(rows.products, TAU)
    is_quiet = statistics.residual_squares < statistics.degrees_of_freedom
    assert is_quiet.all(), "the case must be quiet for the reference to be normal"
    tolerance = 1e-8 if len(chosen) == 1 else 0.03
    assert log_bayes_factor(rows, terms) == pytest.approx(
        brute_log_bayes_factor(rows, terms), abs=tolerance
    )


@pytest.mark.parametrize("squares", [10.0, 49.9, 50.1, 80.0, 400.0])
def test_the_size_of_the_noise_is_the_most_likely_one_of_at_least_one(squares):
    def negative_log_likelihood(log_variance):
        return 25 * log_variance + 0.5 * squares / np.exp(log_variance)

    best = minimize_scalar(
        negative_log_likelihood,
        bounds=(0.0, 10.0),
        method="bounded",
        options={"xatol": 1e-10},
    )
    assert log_likelihood(squares, 50) == pytest.approx(-best.fun, abs=1e-6)


def half_normal_evidence(rows, tau, columns, signs, scale):
    """Integral of the likelihood over half-normal coefficients, by quadrature, relative
    to that without them."""
    without = multivariate_normal(rows.expected, rows.marginal_covariance(tau))
    reference = without.logpdf(rows.residual)

    def density(*sizes):
        contribution = rows.candidates[:, columns] @ (np.array(sizes) * signs)
        likelihood = np.exp(without.logpdf(rows.residual - contribution) - reference)
        return likelihood * np.prod([2 * norm.pdf(size, scale=scale) for size in sizes])

    if len(columns) == 1:
        return np.log(quad(density, 0, 8 * scale, limit=200, epsabs=1e-12)[0])
    return np.log(
        dblquad(density, 0, 6 * scale, 0, 6 * scale, epsabs=1e-9, epsrel=1e-6)[0]
    )


@pytest.mark.parametrize(
    ("columns", "signs", "size", "tolerance"),
    [
        ([2], [1], 0.3, 1e-5),
        ([2], [-1], 0.0, 1e-5),
        ([2], [1], -0.3, 1e-5),
        ([0, 1], [1, -1], 0.05, 0.05),
    ],
)
def test_half_normal_priors_are_exact_for_one_coefficient_and_independent_for_two(
    columns, signs, size, tolerance
):
    """The probability of an orthant is taken as the product of its sides. For two
    coefficients with a correlation of 0.2 that is right to 0.05 nats."""
    rows = quiet_rows(12, size * np.bincount(columns, signs, 6))
    scale = 0.3 if len(columns) == 1 else 0.1
    term = replace(make_term("b", (1,), columns), signs=np.array(signs))
    statistics = compute_statistics(rows.products, [0.3])
    grid = grid_of_one(scale)
    with_term = evaluate_model(statistics, [term], grid, np.zeros(1), [scale])
    without = evaluate_model(statistics, [], grid, np.zeros(1), [])
    assert with_term.log_evidence - without.log_evidence == pytest.approx(
        half_normal_evidence(rows, 0.3, columns, signs, scale), abs=tolerance
    )


def test_evidence_is_averaged_over_the_scales_that_a_term_may_have():
    """The signal is so small that the excluded scales are the likely ones; the result
    does not depend on the scale at which the ascent starts."""
    rows = quiet_rows(1, (0.02, -0.01))
    term = replace(TERMS[0], smallest=3)
    log_weights = GRID.log_weights[3:]
    large_scales = SizeGrid(GRID.scales[3:], log_weights - logsumexp(log_weights))
    expected = brute_log_bayes_factor(rows, [term], large_scales)
    nothing = evaluate(rows, ()).log_evidence
    for start in SETTINGS.scales:
        evidence = evaluate(rows, [term], [start])
        assert evidence.log_evidence - nothing == pytest.approx(expected, abs=1e-8)
        assert evidence.scales[0] >= GRID.scales[3]
        # Without the term the model is the smaller one, whatever scales are excluded.
        assert evidence.without[0] == pytest.approx(nothing, abs=1e-8)
    assert expected < brute_log_bayes_factor(rows, [term]) - 1.0


def test_moments_have_the_noise_that_a_model_leaves_if_that_is_more_than_was_assumed():
    rows = quiet_rows(1, SIGNALS["b"])
    rows = replace(rows, residual=rows.expected + 9.0 * (rows.residual - rows.expected))
    statistics = compute_statistics(rows.products, [0.3])
    scale = 0.3
    density = ModelDensity(
        statistics, TERMS[:1], grid_of_one(scale), np.zeros(1), np.zeros(1, int)
    )
    ((_, variance),) = density.moments()
    precision = statistics.gram_blocks(np.arange(2))[0] + np.eye(2) / scale**2
    score = statistics.score[0, :2]
    squares = statistics.residual_squares[0] - score @ np.linalg.solve(precision, score)
    assert squares > 2.0 * statistics.degrees_of_freedom
    noise_variance = squares / statistics.degrees_of_freedom
    np.testing.assert_allclose(
        variance, noise_variance * np.diag(np.linalg.inv(precision))
    )


@pytest.mark.parametrize("std_error_rad", [1e-7, 1e-5, 1e-3])
def test_the_grid_of_the_pose_error_reaches_beyond_what_physics_allows(std_error_rad):
    sizes = list_pose_errors(std_error_rad, SETTINGS)
    assert sizes[0] == 0.0
    assert sizes[-1] >= 2.0 * SETTINGS.largest_pose_error_rad
    assert sizes[-1] >= 16.0 * std_error_rad
    assert (sizes[2:] / sizes[1:-1]).max() <= 2.0 + 1e-9


def test_pose_errors_have_a_half_cauchy_prior_beside_their_absence():
    sizes = np.array([0.0, 1.0, 2.0, 20.0]) * SETTINGS.pose_repeatability_rad
    prior = np.exp(compute_pose_error_log_prior(sizes, SETTINGS))
    assert prior.sum() == pytest.approx(1.0)
    assert prior[0] == pytest.approx(1.0 - SETTINGS.pose_error_probability)
    # Densities in the logarithm of the size: x / (1 + x^2).
    assert prior[1] / prior[3] == pytest.approx((1 / 2) / (20 / 401))
    alone = compute_pose_error_log_prior(np.zeros(1), SETTINGS)
    assert alone == pytest.approx(np.log(1.0 - SETTINGS.pose_error_probability))
