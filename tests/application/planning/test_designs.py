"""Criteria against their definitions, chosen designs against all subsets."""

from itertools import combinations

import numpy as np
import pytest
from made_surveys import make_rows

from elastocal.application.planning.designs import (
    CRITERIA,
    build_criterion,
    choose_greedily,
    compute_information_matrix,
    exchange_candidates,
)

ACCURACY_ROWS = make_rows(7, 3, 5, 2).astype(float)


@pytest.mark.parametrize("kind", CRITERIA)
def test_gains_are_right_for_an_unknown_base_under_opposite_pulls(kind):
    """The middle rows, thirty thousand in size, follow from the others: I + Z Z' is
    singular in single precision."""
    stream = np.random.default_rng(3)
    scale = np.array([3e4, 3e4, 3e4, 10.0, 1.0])
    pulled, pushed = stream.standard_normal((2, 30, 3, 5)) * scale
    rows = np.concatenate([pulled, 0.5 * (pulled + pushed), pushed], axis=1)
    criterion = build_criterion(kind, ACCURACY_ROWS)
    prior = np.eye(5)
    expected = [
        criterion.value(prior + row.T @ row) - criterion.value(prior) for row in rows
    ]
    np.testing.assert_allclose(criterion.gains(rows, prior), expected, rtol=1e-4)
    single = criterion.gains(rows.astype(np.float32), prior)
    np.testing.assert_allclose(single, expected, rtol=1e-2)


@pytest.mark.parametrize("kind", CRITERIA)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_exchange_is_near_the_best_of_all_subsets(kind, seed):
    rows = make_rows(12, 3, 5, seed)
    criterion = build_criterion(kind, ACCURACY_ROWS)
    greedy = choose_greedily(rows, 4, criterion)
    design = exchange_candidates(rows, greedy, criterion)
    value = criterion.value(compute_information_matrix(rows, design))
    values = [
        criterion.value(compute_information_matrix(rows, list(subset)))
        for subset in combinations(range(12), 4)
    ]
    assert value >= max(values) - 0.02 * (max(values) - np.median(values))
