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
def test_gains_are_differences_of_the_value(kind):
    rule, matrix = criterion(kind, PLACES), start()
    expected = [rule.value(matrix + row.T.astype(float) @ row) - rule.value(matrix) for row in ROWS]
    np.testing.assert_allclose(rule.gains(ROWS, matrix), expected, rtol=1e-3, atol=1e-5)


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
