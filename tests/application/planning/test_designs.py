"""Criteria against their definitions, chosen designs against all there are."""

from itertools import combinations

import numpy as np
import pytest
from made_surveys import made_rows

from elastocal.application.planning.designs import (
    CRITERIA,
    build_criterion,
    choose_greedily,
    compute_information_matrix,
    exchange_candidates,
)

ROWS = made_rows()
PLACES = made_rows(7, 3, 5, 2).astype(float)


@pytest.mark.parametrize("kind", CRITERIA)
def test_an_unknown_base_under_opposite_pulls_leaves_the_prior_its_1(kind):
    """Rows of thirty thousand of which the middle ones follow from the others: I + Z Z'
    is singular in single precision."""
    draws = np.random.default_rng(3)
    scale = np.array([3e4, 3e4, 3e4, 10.0, 1.0])
    ends = draws.standard_normal((2, 30, 3, 5)) * scale
    rows = np.concatenate([ends[0], 0.5 * (ends[0] + ends[1]), ends[1]], axis=1)
    rule = build_criterion(kind, PLACES)
    expected = [
        rule.value(np.eye(5) + row.T @ row) - rule.value(np.eye(5)) for row in rows
    ]
    np.testing.assert_allclose(rule.gains(rows, np.eye(5)), expected, rtol=1e-4)
    np.testing.assert_allclose(
        rule.gains(rows.astype(np.float32), np.eye(5)), expected, rtol=1e-2
    )


@pytest.mark.parametrize("kind", CRITERIA)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_exchange_is_near_the_best_of_all_subsets(kind, seed):
    rows = made_rows(12, 3, 5, seed)
    rule = build_criterion(kind, PLACES)
    found = rule.value(
        compute_information_matrix(
            rows, exchange_candidates(rows, choose_greedily(rows, 4, rule), rule)
        )
    )
    values = [
        rule.value(compute_information_matrix(rows, list(some)))
        for some in combinations(range(12), 4)
    ]
    assert found >= max(values) - 0.02 * (max(values) - np.median(values))
