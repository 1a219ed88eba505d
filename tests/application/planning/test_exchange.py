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


def test_the_exchange_never_makes_a_design_worse_and_takes_no_candidate_twice():
    rows, rule = made_rows(60, 3, 5, 5), criterion("D", PLACES)
    start = list(range(8))
    found = exchange_candidates(rows, start, rule)
    assert rule.value(matrix_of(rows, found)) > rule.value(matrix_of(rows, start))
    assert len(set(found)) == 8


def test_greedy_takes_first_what_tells_most():
    rows, rule = made_rows(), criterion("D", PLACES)
    assert choose_greedily(rows, 1, rule) == [int(np.argmax(rule.gains(rows, np.eye(5))))]
