"""Stages of least squares against closed forms."""

import numpy as np
import pytest

from elastocal_proof.audit.estimates import points_of, solve_staged

ONE = {"stages": [{"points": ["a"], "joints": [1, 2]}]}
TWO = {"stages": [{"points": ["a"], "joints": [1]}, {"points": ["b"], "joints": [2], "held": [1]}]}


def test_one_stage_is_the_normal_equations():
    rng = np.random.default_rng(1)
    matrix, right = rng.normal(size=(9, 2)), rng.normal(size=9)
    found, covariance, condition = solve_staged(ONE, {"a": matrix}, {"a": right}, 2)
    np.testing.assert_allclose(found, np.linalg.solve(matrix.T @ matrix, matrix.T @ right))
    np.testing.assert_allclose(covariance, np.linalg.inv(matrix.T @ matrix))
    assert condition == pytest.approx(np.linalg.cond(matrix))


def test_errors_of_a_stage_reach_the_next_one():
    """c1 = y1 and c2 = y2 - c1, so that its variance is 2."""
    regressors = {"a": np.array([[1.0, 0.0]]), "b": np.array([[1.0, 1.0]])}
    found, covariance, _ = solve_staged(TWO, regressors, {"a": np.array([3.0]), "b": np.array([5.0])}, 2)
    assert found == pytest.approx([3.0, 2.0])
    np.testing.assert_allclose(covariance, [[1, -1], [-1, 2]], atol=1e-12)


def test_a_strategy_reads_each_point_once():
    assert points_of(TWO) == ["a", "b"]
