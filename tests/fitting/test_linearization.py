"""Sensitivities by central differences of exact residuals; products of columns in two
factors as of those written out."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic import (
    NOISE,
    find_candidate,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
    slopes,
    small_steps,
)

from elastocal.campaigns.campaign import Target
from elastocal.fitting import linearization
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.linearization import FactoredSensitivities, linearize
from elastocal.fitting.model import evaluate_conditions, list_parameters


def made(seed, states=5, observations=17, rows=3, coordinates=4, columns=6):
    """Columns that displace none to three coordinates, and their laws; in every state
    one observation at least."""
    rng = np.random.default_rng(seed)
    state = rng.permutation(
        np.concatenate(
            [np.arange(states), rng.integers(0, states, observations - states)]
        )
    )
    chosen = [
        rng.choice(coordinates, rng.integers(0, min(coordinates, 3) + 1), replace=False)
        for _ in range(columns)
    ]
    laws = [{int(c): rng.standard_normal(states) for c in some} for some in chosen]
    sizes = rng.uniform(0.5, 2.0, columns)
    jacobian = rng.standard_normal((observations, rows, coordinates))
    return FactoredSensitivities.of(laws, jacobian, state, states, sizes), laws, sizes


MADE = st.builds(
    made,
    st.integers(0, 10**6),
    states=st.integers(1, 6),
    observations=st.integers(6, 20),
    rows=st.sampled_from([3, 6]),
    coordinates=st.integers(1, 5),
    columns=st.integers(0, 7),
)


@settings(deadline=None)
@given(MADE, st.sampled_from([1, 20, 10**6]))
def test_products_are_those_of_the_columns_written_out_however_many_states_are_taken_at_once(
    given_columns, at_once
):
    columns, laws, sizes = given_columns
    dense = np.zeros((*columns.jacobian.shape[:2], len(laws)))
    for number, law in enumerate(laws):
        for coordinate, values in law.items():
            dense[..., number] += (
                sizes[number]
                * columns.jacobian[..., coordinate]
                * values[columns.state, None]
            )
    np.testing.assert_allclose(columns.dense(), dense, atol=1e-12)
    np.testing.assert_allclose(
        columns.select_columns(sizes > 1.2).dense(), dense[..., sizes > 1.2], atol=1e-12
    )
    np.testing.assert_allclose(
        columns.at(columns.state > 0).dense(), dense[columns.state > 0], atol=1e-12
    )
    right = np.random.default_rng(1).standard_normal((*dense.shape[:2], 2))
    # States of one pose one after the other, not all poses of one size.
    pose = columns.state // 2
    with mock.patch.object(linearization, "_AT_ONCE", at_once):
        gram = columns.gram()
        products = columns.times(right)
        of_poses = columns.multiply_by_pose(right, pose)
    np.testing.assert_allclose(
        gram, np.tensordot(dense, dense, ((0, 1), (0, 1))), atol=1e-10
    )
    np.testing.assert_allclose(
        products, np.tensordot(dense, right, ((0, 1), (0, 1))), atol=1e-10
    )
    expected = [
        np.einsum("mrk,mrn->nk", dense[pose == p], right[pose == p])
        for p in range(pose.max() + 1)
    ]
    np.testing.assert_allclose(of_poses, expected, atol=1e-10)


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_what_two_columns_have_in_common_is_known_to_the_rounding_of_their_squares(
    size,
):
    """A column and one that is a thousandth off it."""
    rng = np.random.default_rng(4)
    law = size * rng.standard_normal(30)
    off = 1e-3 * size * rng.standard_normal(30)
    jacobian = rng.standard_normal((30, 3, 2))
    gram = FactoredSensitivities.of(
        [{0: law}, {0: law, 1: off}], jacobian, np.arange(30), 30
    ).gram()
    rest = gram[1, 1] - 2 * gram[0, 1] + gram[0, 0]
    assert rest == pytest.approx(
        (off**2 * (jacobian[..., 1] ** 2).sum(axis=1)).sum(), rel=1e-8
    )


def assert_slopes(model, estimate, seen, shape):
    """Sensitivities are central differences of the residuals; every parameter is
    seen."""
    around = evaluate_conditions(model, estimate, seen.states)
    steps = np.diag(small_steps(model, estimate))
    expected = slopes(model, estimate, seen, around, steps)
    found = linearize(model, estimate, seen, around).sensitivities @ steps
    largest = np.abs(expected).max(axis=(0, 1))
    assert (
        found.shape == expected.shape == (*shape, len(list_parameters(model, estimate)))
        and (largest > 0).all()
    )
    np.testing.assert_allclose(found / largest, expected / largest, rtol=0, atol=1e-5)


def test_sensitivities_are_central_differences_of_the_residuals(full_case):
    assert_slopes(*full_case, (24, full_case[0].rows))


def test_a_mount_of_unknown_turn_and_a_known_one_at_an_unknown_place_have_their_sensitivities(
    fanuc,
):
    targets = (
        Target("turned", "6DoF", (0.1, 0.0, 0.2), None),
        Target("placed", "3DoF", None, (0.3, -1.0, 0.2)),
    )
    model = make_model(fanuc.chain, targets, rows=6)
    estimate = make_estimate(model, seed=1)
    states = make_states(6, 8, seed=2)
    assert_slopes(model, estimate, observe_exactly(model, estimate, states), (16, 6))


def test_the_place_of_a_jump_has_no_slope_where_a_row_is_within_a_step_of_it(fanuc):
    model = make_model(fanuc.chain, effects=[find_candidate(fanuc.chain, "setup_step")])
    states = make_states(6, 9, seed=3)
    seen = observe_exactly(model, make_estimate(model, seed=4), states)
    # A row at a half lies on the other side of the jump a step further on.
    estimate = replace(make_estimate(model, seed=5), shapes=(np.array([0.5 - 1e-6]),))
    line = linearize(
        model, estimate, seen, evaluate_conditions(model, estimate, states)
    )
    assert not line.sensitivities[..., -1].any() and line.sensitivities[..., -2].any()
    found = fit_model(model, seen, NOISE, estimate)
    assert (
        found.unidentifiable[-1]
        and found.estimate.shapes[0] == estimate.shapes[0]
        and found.converged
    )
