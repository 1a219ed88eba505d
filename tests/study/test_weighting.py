"""Equal weights against those of the noise: simulated least squares, statsmodels, and trackers by hand."""

import numpy as np
import pytest
from statsmodels.api import WLS

from elastocal.study.weighting import expected_errors, range_noise


@pytest.fixture(scope="module")
def made():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((5, 3))
    return rng.standard_normal((2, 30, 3)), rng.uniform(0.5, 4.0, (2, 30)), root.T @ root


def test_equal_weights_leave_what_simulated_least_squares_leave(made):
    """20,000 fits a data set: 1 % in the mean square."""
    regressor, deviation, moment = made
    squares = []
    for A, std in zip(regressor, deviation, strict=True):
        noise = std[:, None] * np.random.default_rng(2).standard_normal((30, 20_000))
        wrong = np.linalg.lstsq(A, noise, rcond=None)[0]
        squares.append((wrong * (moment @ wrong)).sum(axis=0).mean())
    assert expected_errors(regressor, deviation, moment)[0] == pytest.approx(np.sqrt(np.mean(squares)), rel=0.02)


def test_weights_of_the_noise_leave_the_covariance_of_weighted_least_squares(made):
    regressor, deviation, moment = made
    squares = [
        (moment * WLS(np.zeros(30), A, weights=std**-2.0).fit().normalized_cov_params).sum()
        for A, std in zip(regressor, deviation, strict=True)
    ]
    assert expected_errors(regressor, deviation, moment)[1] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_the_noise_of_a_tracker_grows_with_the_range():
    found = range_noise(np.array([[4.0, 0.0, 0.0], [4.0, 3.0, 0.0]]), np.array([4.0, 0.0, 0.0]), 4e-5, 1e-5)
    assert found.tolist() == pytest.approx([4e-5, 5e-5])
