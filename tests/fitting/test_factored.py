"""Columns in two factors: products as of the columns written out, whatever states, targets and coordinates there are."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elastocal.fitting import factored
from elastocal.fitting.linearization import Displacements, Factored, effect_columns


class Laws:
    """An effect whose laws are given."""

    def __init__(self, laws):
        self.laws = laws

    def displacement(self, around):
        return self.laws


def made(seed, states=5, observations=17, rows=3, coordinates=4, columns=6):
    """Columns that displace none to three coordinates, and their laws; in every state one observation at least."""
    rng = np.random.default_rng(seed)
    state = rng.permutation(np.concatenate([np.arange(states), rng.integers(0, states, observations - states)]))
    chosen = [rng.choice(coordinates, rng.integers(0, min(coordinates, 3) + 1), replace=False) for _ in range(columns)]
    laws = [{int(c): rng.standard_normal(states) for c in some} for some in chosen]
    sizes, jacobian = rng.uniform(0.5, 2.0, columns), rng.standard_normal((observations, rows, coordinates))
    return Factored(Displacements.of(laws, sizes, states), jacobian, state), laws, sizes


MADE = st.builds(
    made,
    st.integers(0, 10**6),
    states=st.integers(1, 6),
    observations=st.integers(6, 20),
    rows=st.sampled_from([3, 6]),
    coordinates=st.integers(1, 5),
    columns=st.integers(0, 7),
)


@given(MADE)
def test_written_out_they_are_the_columns_that_effects_make(given_columns):
    columns, laws, sizes = given_columns
    around = SimpleNamespace(joint_angles=np.zeros((columns.displacements.values.shape[1], 1)))
    expected = effect_columns([(Laws(laws), ())], around, columns.jacobian, columns.state) * sizes
    np.testing.assert_allclose(columns.dense(), expected, atol=1e-12)


@settings(deadline=None)
@given(MADE, st.sampled_from([1, 20, 10**6]))
def test_products_are_those_of_the_columns_written_out_however_many_states_are_taken_at_once(given_columns, at_once):
    columns, _, _ = given_columns
    dense = columns.dense()
    right = np.random.default_rng(1).standard_normal((*dense.shape[:2], 2))
    with mock.patch.object(factored, "_AT_ONCE", at_once):
        gram, products = columns.gram(), columns.times(right)
    np.testing.assert_allclose(gram, np.tensordot(dense, dense, ((0, 1), (0, 1))), atol=1e-10)
    np.testing.assert_allclose(products, np.tensordot(dense, right, ((0, 1), (0, 1))), atol=1e-10)
    # States of one pose one after the other, not all poses of one size.
    pose = columns.state // 2
    expected = [np.einsum("mrk,mrn->nk", dense[pose == p], right[pose == p]) for p in range(pose.max() + 1)]
    np.testing.assert_allclose(columns.times_by_pose(right, pose), expected, atol=1e-10)


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_what_two_columns_have_in_common_is_known_to_the_rounding_of_their_squares(size):
    """A column and one that is a thousandth off it."""
    rng = np.random.default_rng(4)
    law, off = size * rng.standard_normal(30), 1e-3 * size * rng.standard_normal(30)
    jacobian = rng.standard_normal((30, 3, 2))
    gram = Factored(Displacements.of([{0: law}, {0: law, 1: off}], np.ones(2), 30), jacobian, np.arange(30)).gram()
    rest = gram[1, 1] - 2 * gram[0, 1] + gram[0, 0]
    assert rest == pytest.approx((off**2 * (jacobian[..., 1] ** 2).sum(axis=1)).sum(), rel=1e-8)
