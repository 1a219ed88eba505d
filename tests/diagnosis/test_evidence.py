"""Bayes factors: marginal likelihoods of all measurements, integrated by brute
force."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import made_rows, made_unit
from scipy.integrate import dblquad, quad
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from elastocal.diagnosis.evidence import (
    ModelDensity,
    SizeGrid,
    compute_pose_error_log_prior,
    evaluate_model,
    log_likelihood,
)
from elastocal.diagnosis.settings import Settings
from elastocal.diagnosis.statistics import compute_statistics

TAU = np.array([0.0, 0.3, 0.9])
SETTINGS = Settings()
GRID = SizeGrid.from_settings(SETTINGS)
LOG_POSE = compute_pose_error_log_prior(TAU, SETTINGS)
# Residuals of a little less than the noise, so that its size is at its floor and
# everything is normal.
QUIET = 0.5
UNITS = (
    made_unit("a", (1,), [0, 1]),
    made_unit("b", (1,), 2),
    made_unit("c", (1,), [3, 4, 5]),
)


def quiet(seed, signal=()):
    """Rows with less noise than declared, and a signal of some candidates."""
    rows = made_rows(seed, poses=12)
    signal = np.array([*signal, *np.zeros(rows.candidates.shape[1] - len(signal))])
    noise = QUIET * (rows.residual - rows.expected)
    return replace(rows, residual=rows.expected + noise + rows.candidates @ signal)


def log_density(rows, tau, deviations):
    """ln N(y; X mu, V(tau) + W D W'), scipy's, with nothing left out."""
    covariance = (
        rows.marginal_covariance(tau)
        + (rows.candidates * deviations**2) @ rows.candidates.T
    )
    return multivariate_normal(rows.expected, covariance).logpdf(rows.residual)


def deviations_of(units, scales):
    found = np.zeros(6)
    for unit, scale in zip(units, scales, strict=True):
        found[unit.columns] = scale
    return found


def brute_log_bayes_factor(rows, units, grid=GRID):
    """Sum over all combinations of sizes and of the pose error."""
    total = []
    for numbers in np.ndindex(*[len(grid.scales)] * len(units)):
        weight = grid.log_weights[list(numbers)].sum()
        deviations = deviations_of(units, grid.scales[list(numbers)])
        total += [
            weight + pose + log_density(rows, tau, deviations)
            for tau, pose in zip(TAU, LOG_POSE, strict=True)
        ]
    nothing = [
        pose + log_density(rows, tau, np.zeros(6))
        for tau, pose in zip(TAU, LOG_POSE, strict=True)
    ]
    return logsumexp(total) - logsumexp(nothing)


def evaluated(rows, units, start=None):
    statistics = compute_statistics(rows.products, TAU)
    start = [SETTINGS.scale_center] * len(units) if start is None else start
    return evaluate_model(statistics, units, GRID, LOG_POSE, start)


def part_of_grid(kept):
    """A grid of some of the sizes alone."""
    return SizeGrid(
        GRID.scales[kept], GRID.log_weights[kept] - logsumexp(GRID.log_weights[kept])
    )


def log_bayes_factor(rows, units):
    return evaluated(rows, units).log_evidence - evaluated(rows, ()).log_evidence


SIGNALS = {
    "nothing": (),
    "a": (0.4, -0.3),
    "b": (0, 0, 0.5),
    "a little of all": (0.1, 0.1, -0.1, 0.1, 0.0, 0.1),
}


@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("chosen", [(0,), (1,), (2,), (0, 1), (0, 1, 2)])
def test_evidence_is_that_of_all_combinations_of_sizes(signal, chosen):
    """Exact of one unit; of several to 0.03 nats: their sizes are not quite independent
    given the measurements."""
    rows = quiet(3, SIGNALS[signal])
    units = [UNITS[number] for number in chosen]
    statistics = compute_statistics(rows.products, TAU)
    assert (statistics.residual_squares < statistics.degrees_of_freedom).all(), (
        "the case must be quiet for the reference to be normal"
    )
    expected = brute_log_bayes_factor(rows, units)
    assert log_bayes_factor(rows, units) == pytest.approx(
        expected, abs=1e-8 if len(chosen) == 1 else 0.03
    )


@pytest.mark.parametrize("squares", [10.0, 49.9, 50.1, 80.0, 400.0])
def test_the_size_of_the_noise_is_the_most_likely_one_of_at_least_one(squares):
    def negative(log_variance):
        return 25 * log_variance + 0.5 * squares / np.exp(log_variance)

    best = minimize_scalar(
        negative, bounds=(0.0, 10.0), method="bounded", options={"xatol": 1e-10}
    )
    assert log_likelihood(squares, 50) == pytest.approx(-best.fun, abs=1e-6)


def half_normal_evidence(rows, tau, columns, signs, scale):
    """Integral of the likelihood over half-normal coefficients, by quadrature, relative
    to that without them."""
    nothing = multivariate_normal(rows.expected, rows.marginal_covariance(tau))
    zero = nothing.logpdf(rows.residual)

    def density(*sizes):
        moved = rows.candidates[:, columns] @ (np.array(sizes) * signs)
        likelihood = np.exp(nothing.logpdf(rows.residual - moved) - zero)
        return likelihood * np.prod([2 * norm.pdf(size, scale=scale) for size in sizes])

    if len(columns) == 1:
        return np.log(quad(density, 0, 8 * scale, limit=200, epsabs=1e-12)[0])
    return np.log(
        dblquad(density, 0, 6 * scale, 0, 6 * scale, epsabs=1e-9, epsrel=1e-6)[0]
    )


@pytest.mark.parametrize(
    ("columns", "signs", "size", "within"),
    [
        ([2], [1], 0.3, 1e-5),
        ([2], [-1], 0.0, 1e-5),
        ([2], [1], -0.3, 1e-5),
        ([0, 1], [1, -1], 0.05, 0.05),
    ],
)
def test_half_normal_priors_are_exact_of_one_coefficient_and_taken_one_by_one_of_two(
    columns, signs, size, within
):
    """The probability of an orthant as the product of its sides: of two coefficients,
    correlated by 0.2, right to 0.05 nats."""
    rows = quiet(12, size * np.bincount(columns, signs, 6))
    scale = 0.3 if len(columns) == 1 else 0.1
    unit = replace(made_unit("b", (1,), columns), signs=np.array(signs))
    one = compute_statistics(rows.products, [0.3])
    grid = SizeGrid(np.array([scale]), np.zeros(1))
    found = [
        evaluate_model(one, units, grid, np.zeros(1), [scale] * len(units))
        for units in ([unit], [])
    ]
    expected = half_normal_evidence(rows, 0.3, columns, signs, scale)
    assert found[0].log_evidence - found[1].log_evidence == pytest.approx(
        expected, abs=within
    )


def test_evidence_is_averaged_over_the_sizes_that_a_unit_may_have():
    """Of a small signal, for which the sizes left out are the likely ones: wherever the
    search for the sizes starts."""
    rows = quiet(1, (0.02, -0.01))
    unit = replace(UNITS[0], smallest=3)
    expected = brute_log_bayes_factor(rows, [unit], part_of_grid(slice(3, None)))
    for start in SETTINGS.scales:
        found = evaluated(rows, [unit], [start])
        assert found.log_evidence - evaluated(rows, ()).log_evidence == pytest.approx(
            expected, abs=1e-8
        )
        assert found.scales[0] >= GRID.scales[3]
    assert expected < brute_log_bayes_factor(rows, [unit]) - 1.0
    # Without it the model is the smaller one all the same.
    assert found.without[0] == pytest.approx(evaluated(rows, ()).log_evidence, abs=1e-8)


def test_moments_have_the_noise_that_a_model_leaves_where_that_is_more_than_was_taken():
    rows = quiet(1, SIGNALS["b"])
    rows = replace(rows, residual=rows.expected + 9.0 * (rows.residual - rows.expected))
    one = compute_statistics(rows.products, [0.3])
    scale = 0.3
    joint = ModelDensity(
        one,
        UNITS[:1],
        SizeGrid(np.array([scale]), np.zeros(1)),
        np.zeros(1),
        np.zeros(1, int),
    )
    ((_, variance),) = joint.moments()
    inner = one.gram_blocks(np.arange(2))[0] + np.eye(2) / scale**2
    left = one.residual_squares[0] - one.score[0, :2] @ np.linalg.solve(
        inner, one.score[0, :2]
    )
    assert left > 2.0 * one.degrees_of_freedom
    np.testing.assert_allclose(
        variance, left / one.degrees_of_freedom * np.diag(np.linalg.inv(inner))
    )
