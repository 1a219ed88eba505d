"""Measurements summed block by block: the same statistics as of measurements that are held, and draws that follow them."""

from dataclasses import replace

import numpy as np
import pytest
from made_problems import made_rows
from scipy.stats import chi2, kstest

from elastocal.diagnosis.statistics import normal_equations, null_draws, statistics_of
from elastocal.diagnosis.summed import rows_at_once, summed, triangle_of

TAU = np.array([0.0, 0.1, 0.7])


def in_order(rows):
    """The same rows, those of each pose together."""
    order = np.argsort(rows.pose, kind="stable")
    parts = ("declared", "candidates", "residual", "jacobian", "pose")
    return replace(rows, **{name: getattr(rows, name)[order] for name in parts})


def blocks_of(rows, poses_each, by_pose):
    """`WhiteRows` of so many poses at a time; the poses number from 0 in each."""
    for first in range(0, rows.pose.max() + 1, poses_each):
        yield rows.white((rows.pose >= first) & (rows.pose < first + poses_each), by_pose)


def summed_of(rows, poses_each=3, taus=TAU, by_pose=False):
    rows = in_order(rows)
    triangle = triangle_of(rows.declared[start : start + 7] for start in range(0, len(rows.declared), 7))
    return summed(blocks_of(rows, poses_each, by_pose), triangle, rows.prior_std, rows.present, taus)


CASES = {
    "poses of unequal size": {},
    "priors that matter": {"prior": 0.3},
    "one measurement a pose": {"size": (1, 3), "poses": 20},
}


@pytest.mark.parametrize("by_pose", [False, True])
@pytest.mark.parametrize("poses_each", [1, 3, 100])
@pytest.mark.parametrize("case", CASES)
def test_statistics_of_sums_are_those_of_measurements_that_are_held(case, poses_each, by_pose):
    """Whether poses have several states or are one each."""
    rows = made_rows(1, **CASES[case])
    found, expected = (statistics_of(each, TAU) for each in (summed_of(rows, poses_each, by_pose=by_pose), rows.products))
    for name in ("gram", "along", "squares"):
        scale = np.abs(getattr(expected, name)).max()
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-9, atol=1e-9 * scale, err_msg=name)
    np.testing.assert_allclose(np.diff(found.log_likelihood), np.diff(expected.log_likelihood), rtol=1e-8, atol=1e-9)
    assert found.freedom == expected.freedom


@pytest.mark.parametrize("by_pose", [False, True])
def test_what_the_declared_parameters_explain_costs_rounding_of_its_square_alone(by_pose):
    """A candidate whose share that they explain is ten thousand times what is left, of some noise a row: eight digits stay."""
    rows, rng = made_rows(4, declared=4, candidates=3), np.random.default_rng(5)
    mixed = rows.declared @ rng.standard_normal((4, 3))
    rows = replace(rows, candidates=1e4 * mixed + rows.candidates, prior_std=np.full(4, 1e5), present=np.zeros(4))
    dense = [rows.candidates.T @ np.linalg.inv(rows.marginal_covariance(tau)) @ rows.candidates for tau in TAU]
    for found in (statistics_of(each, TAU) for each in (summed_of(rows, by_pose=by_pose), rows.products)):
        np.testing.assert_allclose(found.gram, dense, rtol=1e-4, atol=1e-6 * np.abs(dense).max())


def test_the_nearest_size_of_the_pose_error_counts():
    sums = summed_of(made_rows(7))
    for tau, place in ((0.0, 0), (0.04, 0), (0.06, 1), (0.39, 1), (0.41, 2), (9.0, 2)):
        total, log_det = normal_equations(sums, tau)
        np.testing.assert_array_equal(total, sums.totals[place])
        assert log_det == sums.log_dets[place]


@pytest.mark.parametrize("rows_each", [1, 3, 200])
def test_a_triangular_factor_of_blocks_has_the_squares_of_all_rows(rows_each):
    rows = np.random.default_rng(8).standard_normal((50, 4)) * [1e-6, 1.0, 1e3, 1.0]
    triangle = triangle_of(rows[start : start + rows_each] for start in range(0, 50, rows_each))
    scale = np.linalg.norm(rows, axis=0)
    np.testing.assert_allclose(
        triangle.T @ triangle / np.outer(scale, scale), rows.T @ rows / np.outer(scale, scale), atol=1e-13
    )
    assert triangle.shape == (4, 4) and not np.tril(triangle, -1).any()


def test_blocks_have_fewer_rows_the_more_columns_there_are_and_one_at_least():
    assert rows_at_once(100) == 2 * rows_at_once(200) > 1 and rows_at_once(10**9) == 1


# 4,000 draws; moments at 5 standard errors fail by chance once in some 3e4 seeds a moment, and see with a power of 0.9 what
# moves one by 6.3 of them: 14 % of a variance. Kolmogorov-Smirnov at 0.1 % sees a shift of 0.1 standard deviations with 0.9.
DRAWS, BEYOND = 4000, 5.0


@pytest.mark.parametrize("tau", [0.0, 0.7])
def test_null_draws_of_sums_have_the_moments_of_simulated_measurements(tau):
    """W'My is normal with covariance W'MW, and y'My a chi-squared of what the declared model leaves."""
    rows = made_rows(9, prior=1e5)
    sums = summed_of(rows)
    along, squares = (part[0] for part in null_draws(sums, tau, np.array([tau]), DRAWS, np.random.default_rng(10)))
    expected = statistics_of(rows.products, [tau])
    size = np.sqrt(np.diag(expected.gram[0]))
    found = along @ along.T / DRAWS / np.outer(size, size)
    assert np.abs(found - expected.gram[0] / np.outer(size, size)).max() < BEYOND * np.sqrt(2 / DRAWS)
    assert np.abs(along.mean(axis=1) / size).max() < BEYOND / np.sqrt(DRAWS)
    assert kstest(squares, chi2(sums.freedom).cdf).pvalue > 1e-3
    # What all candidates together explain is a chi-squared of their number, and independent of what they leave.
    explained = (along * np.linalg.solve(expected.gram[0], along)).sum(axis=0)
    assert kstest(explained, chi2(len(size)).cdf).pvalue > 1e-3
    assert abs(np.corrcoef(explained, squares - explained)[0, 1]) < BEYOND / np.sqrt(DRAWS)
