"""Few poses have Student's interval, and errors without scatter none."""

import numpy as np
from scipy.stats import t as student

from elastocal.validation.held_out import drawn_poses, log_ratio_interval

ENDS = np.array([0.05, 0.95])


def test_few_poses_have_the_interval_of_student_in_closed_form():
    over, under = np.array([1.0, 2.0, 4.0]), np.ones(3)
    assert drawn_poses(3, 100, np.random.default_rng(1)) is None
    left = np.log([3.0, 2.5, 1.5])
    error = np.sqrt(2 / 3 * ((left - left.mean()) ** 2).sum())
    interval, found = log_ratio_interval(over, under, None, ENDS)
    np.testing.assert_allclose([found, *interval], [error, *(np.log(7 / 3) + error * student.ppf(ENDS, 2))], rtol=1e-12)


def test_drawn_poses_reach_about_as_far_as_student_where_errors_are_alike():
    over, under = np.random.default_rng(0).chisquare(3, 60) + 0.1, np.full(60, 4.0)
    weights = drawn_poses(60, 4000, np.random.default_rng(1))
    drawn, error = log_ratio_interval(over, under, weights, ENDS)
    np.testing.assert_allclose(drawn, log_ratio_interval(over, under, None, ENDS)[0], atol=0.35 * error)


def test_errors_without_scatter_are_certain_and_one_pose_says_nothing():
    assert log_ratio_interval(np.ones(5), np.ones(5), None, ENDS)[1] == 0.0
    assert np.isnan(log_ratio_interval(np.ones(1), np.ones(1), None, ENDS)[0]).all()
