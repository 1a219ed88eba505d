"""Equal rows are one group, as numpy.unique has it."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from elastocal.campaigns.groups import groups_of


@given(st.lists(st.tuples(st.integers(-2, 2), st.integers(-2, 2), st.integers(0, 1)), min_size=1, max_size=30))
@settings(max_examples=30)
def test_groups_are_those_of_numpy_unique(rows):
    keys = np.array(rows)
    _, expected_first, expected = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    first, group = groups_of(keys)
    np.testing.assert_array_equal(first, expected_first)
    np.testing.assert_array_equal(group, expected.ravel())
