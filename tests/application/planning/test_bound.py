"""The bound against the best weights that cvxpy finds."""

import cvxpy as cp
import numpy as np
import pytest
from made_surveys import made_rows

from elastocal.application.planning.bound import best_value
from elastocal.application.planning.criteria import CRITERIA, criterion
from elastocal.application.planning.exchange import choose_greedily, exchange_candidates, matrix_of

PLACES = made_rows(7, 3, 5, 2).astype(float)


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
