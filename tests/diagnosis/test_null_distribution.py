"""Simulated statistics have the moments of measurements without a missing effect."""

import numpy as np
import pytest
from made_problems import made_rows

from elastocal.diagnosis import statistics
from elastocal.diagnosis.null_distribution import simulate_null_statistics

TAU = np.array([0.0, 0.1, 0.7, 5.0])
CASES = {"poses of unequal size": {}, "priors that matter": {"prior": 0.3}}
# Moments are compared at 5 standard errors: each test fails by chance once in some ten
# thousand seeds, and sees with a power of 0.9 what moves a moment by 6.3 of them, which
# is 14 % of a variance.
DRAWS = 4000
BEYOND = 5.0


@pytest.mark.parametrize("at_once", [40, 10**6])
@pytest.mark.parametrize("tau", [0.0, 0.6])
@pytest.mark.parametrize("case", ["poses of unequal size", "priors that matter"])
def test_null_draws_have_the_moments_of_simulated_measurements(
    case, tau, at_once, monkeypatch
):
    """W'My has covariance W'M Sigma M'W; y'My has mean tr(M Sigma) and variance 2 tr(M
    Sigma M Sigma)."""
    monkeypatch.setattr(statistics, "_AT_ONCE", at_once)
    rows = made_rows(9, **CASES[case])
    along, squares = simulate_null_statistics(
        rows.products, tau, TAU, DRAWS, np.random.default_rng(10)
    )
    covariance = rows.covariance(tau)
    for number, size in enumerate(TAU):
        M = np.linalg.inv(rows.marginal_covariance(size))
        expected = rows.candidates.T @ M @ covariance @ M @ rows.candidates
        deviation = np.sqrt(np.diag(expected))
        found = along[number] @ along[number].T / DRAWS / np.outer(deviation, deviation)
        assert (
            np.abs(found - expected / np.outer(deviation, deviation))
            < BEYOND * np.sqrt(2 / DRAWS)
        ).all()
        assert (
            np.abs(along[number].mean(axis=1)) < BEYOND * deviation / np.sqrt(DRAWS)
        ).all()
        spread = M @ covariance
        mean = np.trace(spread)
        variance = 2 * np.trace(spread @ spread)
        assert abs(squares[number].mean() - mean) < BEYOND * np.sqrt(variance / DRAWS)
        # Fourth cumulant of a quadratic form: 48 tr (M Sigma)^4.
        fourth = 2 + 48 * np.trace(spread @ spread @ spread @ spread) / variance**2
        assert abs(squares[number].var() - variance) < BEYOND * variance * np.sqrt(
            fourth / DRAWS
        )
        # Odd moments of normal measurements vanish: no correlation of a linear with a
        # quadratic form.
        mixed = (along[number] / deviation[:, None] * (squares[number] - mean)).mean(
            axis=1
        ) / np.sqrt(variance)
        assert (np.abs(mixed) < BEYOND * np.sqrt(3 / DRAWS)).all()
