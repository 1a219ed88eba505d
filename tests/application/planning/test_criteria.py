"""Gains and slopes of the criteria against their definitions."""

import numpy as np
import pytest
from made_surveys import made_rows

from elastocal.application.planning.criteria import CRITERIA, criterion, mean_squares

ROWS = made_rows()
PLACES = made_rows(7, 3, 5, 2).astype(float)


def start():
    return np.eye(5) + np.einsum("nki,nkj->ij", ROWS[:2].astype(float), ROWS[:2].astype(float))


@pytest.mark.parametrize("kind", CRITERIA)
def test_slopes_are_derivatives_of_the_value(kind):
    rule, matrix, step = criterion(kind, PLACES), start(), 1e-6
    expected = [(rule.value(matrix + step * row.T.astype(float) @ row) - rule.value(matrix)) / step for row in ROWS]
    np.testing.assert_allclose(rule.slopes(ROWS, matrix), expected, rtol=1e-3)


def test_the_value_of_i_is_the_mean_variance_over_the_places():
    rule, matrix = criterion("I", PLACES), start()
    variances = np.einsum("nki,ij,nkj->n", PLACES, np.linalg.inv(matrix), PLACES)
    assert -rule.value(matrix) == pytest.approx(variances.mean())
    np.testing.assert_allclose(mean_squares(PLACES), np.einsum("nki,nkj->ij", PLACES, PLACES) / 7)


@pytest.mark.parametrize("kind", CRITERIA)
def test_an_unknown_base_under_opposite_pulls_leaves_the_prior_its_1(kind):
    """Rows of thirty thousand of which the middle ones follow from the others: I + Z Z' is singular in single precision."""
    draws = np.random.default_rng(3)
    scale = np.array([3e4, 3e4, 3e4, 10.0, 1.0])
    ends = draws.standard_normal((2, 30, 3, 5)) * scale
    rows = np.concatenate([ends[0], 0.5 * (ends[0] + ends[1]), ends[1]], axis=1)
    rule = criterion(kind, PLACES)
    expected = [rule.value(np.eye(5) + row.T @ row) - rule.value(np.eye(5)) for row in rows]
    np.testing.assert_allclose(rule.gains(rows, np.eye(5)), expected, rtol=1e-4)
    np.testing.assert_allclose(rule.gains(rows.astype(np.float32), np.eye(5)), expected, rtol=1e-2)
