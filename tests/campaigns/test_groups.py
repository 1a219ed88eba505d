"""Equal rows are one group, as numpy.unique has it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elastocal.campaigns.groups import groups_of


def test_groups_of_rows_written_by_hand():
    keys = np.array([[1, 4], [0, 9], [0, 4], [1, 4], [0, 9], [-1, 7]])
    first, group = groups_of(keys)
    # In lexicographic order: (-1, 7), (0, 4), (0, 9), (1, 4).
    assert first.tolist() == [5, 2, 1, 0]
    assert group.tolist() == [3, 2, 1, 3, 2, 0]


@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(-2, 2), st.integers(0, 1)), min_size=1, max_size=30))
@settings(max_examples=30)
def test_groups_are_those_of_numpy_unique(rows):
    keys = np.array(rows)
    _, expected_first, expected = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    first, group = groups_of(keys)
    np.testing.assert_array_equal(first, expected_first)
    np.testing.assert_array_equal(group, expected.ravel())


@pytest.mark.parametrize("rows", [0, 1])
def test_no_row_is_no_group_and_one_row_is_one(rows):
    first, group = groups_of(np.zeros((rows, 2), int))
    assert (len(first), len(group)) == (rows, rows)
