"""Criteria against their definitions, chosen designs against all there are, the bound against the best weights of cvxpy."""

from itertools import combinations

import cvxpy as cp
import numpy as np
import pytest
from made_surveys import made_rows

from elastocal.application.planning.designs import (
    CRITERIA,
    best_value,
    choose_greedily,
    criterion,
    exchange_candidates,
    matrix_of,
)

ROWS = made_rows()
PLACES = made_rows(7, 3, 5, 2).astype(float)


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


@pytest.mark.parametrize("kind", CRITERIA)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_exchange_is_near_the_best_of_all_subsets(kind, seed):
    rows, rule = made_rows(12, 3, 5, seed), criterion(kind, PLACES)
    found = rule.value(matrix_of(rows, exchange_candidates(rows, choose_greedily(rows, 4, rule), rule)))
    values = [rule.value(matrix_of(rows, list(some))) for some in combinations(range(12), 4)]
    assert found >= max(values) - 0.02 * (max(values) - np.median(values))


def best_by_cvxpy(rows, count, rule):
    weights = cp.Variable(len(rows), nonneg=True)
    matrix = np.eye(rows.shape[2]) + count * sum(w * row.T.astype(float) @ row for w, row in zip(weights, rows, strict=True))
    if rule.weight is None:
        value = cp.log_det(matrix)
    else:
        values, vectors = np.linalg.eigh(rule.weight)
        value = -sum(cp.matrix_frac(np.sqrt(v) * u, matrix) for v, u in zip(values.clip(0), vectors.T, strict=True))
    problem = cp.Problem(cp.Maximize(value), [cp.sum(weights) == 1])
    problem.solve(solver="CLARABEL")
    return problem.value


@pytest.mark.parametrize("kind", CRITERIA)
def test_the_bound_is_the_optimum_of_the_continuous_design(kind):
    rows, rule = made_rows(20, 3, 5, 4), criterion(kind, PLACES)
    chosen = exchange_candidates(rows, choose_greedily(rows, 4, rule), rule)
    bound, best = best_value(rows, 4, rule, chosen), best_by_cvxpy(rows, 4, rule)
    value = rule.value(matrix_of(rows, chosen))
    assert value <= best + 1e-6
    assert bound >= best - 1e-4 * abs(best)
    assert bound - best < 0.1 * max(best - value, 1e-3)
