"""The risk of a one-sided statement is the level of the interval that ends there."""

import numpy as np
import pytest
from scipy.stats import t as student

from elastocal.validation.bootstrap_t import drawn_poses, log_ratio_interval, risk_above


def totals(poses, seed=0):
    rng = np.random.default_rng(seed)
    return rng.chisquare(3, poses) + 0.1, np.full(poses, 4.0)


@pytest.mark.parametrize("poses", [3, 9, 30, 400])
@pytest.mark.parametrize("level", [0.05, 0.2])
def test_the_risk_at_the_upper_end_of_an_interval_is_what_lies_beyond_it(poses, level):
    over, under = totals(poses)
    weights = drawn_poses(poses, 4000, np.random.default_rng(1))
    interval, _ = log_ratio_interval(over, under, weights, np.array([level, 1.0 - level]))
    assert risk_above(over, under, weights, interval[1]) == pytest.approx(level, abs=2e-3)
    assert risk_above(over, under, weights, interval[0]) == pytest.approx(1.0 - level, abs=2e-3)


def test_few_poses_have_the_risk_of_student_in_closed_form():
    over, under = np.array([1.0, 2.0, 4.0]), np.ones(3)
    left = np.log([3.0, 2.5, 1.5])
    error = np.sqrt(2 / 3 * ((left - left.mean()) ** 2).sum())
    expected = student.cdf((np.log(7 / 3) - np.log(3.0)) / error, 2)
    assert risk_above(over, under, None, np.log(3.0)) == pytest.approx(expected)


def test_errors_without_scatter_are_certain_and_one_pose_says_nothing():
    assert risk_above(np.ones(5), np.ones(5), None, 0.1) == 0.0 and risk_above(np.ones(5), np.ones(5), None, -0.1) == 1.0
    assert np.isnan(risk_above(np.ones(1), np.ones(1), None, 0.0))
