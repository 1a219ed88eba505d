"""Simulated statistics have the moments of measurements in which nothing is missing."""

import numpy as np
import pytest
from made_problems import make_rows

from elastocal.diagnosis import statistics
from elastocal.diagnosis.null_distribution import simulate_null_statistics

TAU = np.array([0.0, 0.1, 0.7, 5.0])
CASES = {"poses of unequal size": {}, "priors that matter": {"prior": 0.3}}
# Moments are compared at 5 standard errors. Each test then fails by chance once in some
# ten thousand seeds, and detects with a power of 0.9 an error in a moment of 6.3
# standard errors, which is 14 % of a variance.
DRAWS = 4000
BEYOND = 5.0


def check_score(score, covariance):
    """Draws (K, N) have mean zero and a given covariance (K, K)."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.outer(deviation, deviation)
    difference = score @ score.T / DRAWS / scale - covariance / scale
    assert (np.abs(difference) < BEYOND * np.sqrt(2 / DRAWS)).all()
    mean_error = deviation / np.sqrt(DRAWS)
    assert (np.abs(score.mean(axis=1)) < BEYOND * mean_error).all()


def check_squares(squares, spread):
    """Draws (N,) are quadratic forms of normal numbers: their mean is tr(S) and their
    variance 2 tr(S^2), with `spread` S = M Sigma."""
    mean = np.trace(spread)
    square = spread @ spread
    variance = 2 * np.trace(square)
    assert abs(squares.mean() - mean) < BEYOND * np.sqrt(variance / DRAWS)
    # The fourth cumulant of a quadratic form is 48 tr(S^4).
    fourth = 2 + 48 * np.trace(square @ square) / variance**2
    variance_error = variance * np.sqrt(fourth / DRAWS)
    assert abs(squares.var() - variance) < BEYOND * variance_error
    return mean, variance


@pytest.mark.parametrize("at_once", [40, 10**6])
@pytest.mark.parametrize("tau", [0.0, 0.6])
@pytest.mark.parametrize("case", CASES)
def test_null_draws_have_the_moments_of_simulated_measurements(
    case, tau, at_once, monkeypatch
):
    """W'My has covariance W'M Sigma M'W; y'My has mean tr(M Sigma) and variance 2 tr(M
    Sigma M Sigma)."""
    monkeypatch.setattr(statistics, "_AT_ONCE", at_once)
    rows = make_rows(9, **CASES[case])
    scores, all_squares = simulate_null_statistics(
        rows.products, tau, TAU, DRAWS, np.random.default_rng(10)
    )
    covariance = rows.covariance(tau)
    W = rows.candidates
    for size, score, squares in zip(TAU, scores, all_squares, strict=True):
        M = np.linalg.inv(rows.marginal_covariance(size))
        score_covariance = W.T @ M @ covariance @ M @ W
        check_score(score, score_covariance)
        mean, variance = check_squares(squares, M @ covariance)
        # Odd moments of normal measurements vanish, so that a linear and a quadratic
        # form are uncorrelated.
        standardised = score / np.sqrt(np.diag(score_covariance))[:, None]
        mixed = (standardised * (squares - mean)).mean(axis=1) / np.sqrt(variance)
        assert (np.abs(mixed) < BEYOND * np.sqrt(3 / DRAWS)).all()
