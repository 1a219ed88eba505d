"""Chosen designs against all there are."""

from itertools import combinations

import numpy as np
import pytest
from made_surveys import made_rows

from elastocal.application.planning.criteria import CRITERIA, criterion
from elastocal.application.planning.exchange import choose_greedily, exchange_candidates, matrix_of

PLACES = made_rows(7, 3, 5, 2).astype(float)


@pytest.mark.parametrize("kind", CRITERIA)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_exchange_is_near_the_best_of_all_subsets(kind, seed):
    rows, rule = made_rows(12, 3, 5, seed), criterion(kind, PLACES)
    found = rule.value(matrix_of(rows, exchange_candidates(rows, choose_greedily(rows, 4, rule), rule)))
    values = [rule.value(matrix_of(rows, list(some))) for some in combinations(range(12), 4)]
    assert found >= max(values) - 0.02 * (max(values) - np.median(values))
