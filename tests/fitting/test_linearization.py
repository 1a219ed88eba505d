"""Sensitivities are central differences of exact residuals, and products of factored
sensitivities are those of the dense matrix."""

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


def make_factored(seed, states=5, observations=17, rows=3, coordinates=4, columns=6):
    """Make factored sensitivities whose columns displace none to three coordinates;
    every state has at least one observation.

    Returns
    -------
    FactoredSensitivities
    displacements : list of dict
        Of each column, the displacement of each coordinate, (states,).
    sizes : ndarray (columns,)
        Plausible sizes of the parameters.
    """
    rng = np.random.default_rng(seed)
    state = rng.permutation(
        np.concatenate(
            [np.arange(states), rng.integers(0, states, observations - states)]
        )
    )
    most = min(coordinates, 3)
    coordinates_of_columns = [
        rng.choice(coordinates, rng.integers(0, most + 1), replace=False)
        for _ in range(columns)
    ]
    displacements = []
    for chosen in coordinates_of_columns:
        displacements.append({int(c): rng.standard_normal(states) for c in chosen})
    sizes = rng.uniform(0.5, 2.0, columns)
    jacobian = rng.standard_normal((observations, rows, coordinates))
    factored = FactoredSensitivities.of(displacements, jacobian, state, states, sizes)
    return factored, displacements, sizes


FACTORED = st.builds(
    make_factored,
    st.integers(0, 10**6),
    states=st.integers(1, 6),
    observations=st.integers(6, 20),
    rows=st.sampled_from([3, 6]),
    coordinates=st.integers(1, 5),
    columns=st.integers(0, 7),
)


def write_out(factored, displacements, sizes):
    """Write out the dense sensitivities, column by column."""
    dense = np.zeros((*factored.jacobian.shape[:2], len(displacements)))
    for number, displacement in enumerate(displacements):
        for coordinate, values in displacement.items():
            dense[..., number] += (
                sizes[number]
                * factored.jacobian[..., coordinate]
                * values[factored.state, None]
            )
    return dense


@settings(deadline=None)
@given(FACTORED, st.sampled_from([1, 20, 10**6]))
def test_products_are_those_of_the_dense_sensitivities_for_any_block_size(
    factored_case, block_size
):
    factored, displacements, sizes = factored_case
    dense = write_out(factored, displacements, sizes)
    np.testing.assert_allclose(factored.dense(), dense, atol=1e-12)
    np.testing.assert_allclose(
        factored.select_columns(sizes > 1.2).dense(),
        dense[..., sizes > 1.2],
        atol=1e-12,
    )
    np.testing.assert_allclose(
        factored.at(factored.state > 0).dense(), dense[factored.state > 0], atol=1e-12
    )
    np.testing.assert_allclose(factored.combine(sizes), dense @ sizes, atol=1e-12)
    vectors = np.random.default_rng(1).standard_normal((*dense.shape[:2], 2))
    # The states of a pose follow each other, and poses differ in their size.
    pose = factored.state // 2
    with mock.patch.object(linearization, "_AT_ONCE", block_size):
        gram = factored.gram()
        products = factored.times(vectors)
        products_by_pose = factored.multiply_by_pose(vectors, pose)
    np.testing.assert_allclose(
        gram, np.tensordot(dense, dense, ((0, 1), (0, 1))), atol=1e-10
    )
    np.testing.assert_allclose(
        products, np.tensordot(dense, vectors, ((0, 1), (0, 1))), atol=1e-10
    )
    expected = [
        np.einsum("mrk,mrn->nk", dense[pose == number], vectors[pose == number])
        for number in range(pose.max() + 1)
    ]
    np.testing.assert_allclose(products_by_pose, expected, atol=1e-10)


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_the_gram_matrix_resolves_a_small_difference_of_two_columns(
    size,
):
    """The second column differs from the first by a thousandth. The squared norm of
    the difference follows from the Gram matrix up to the rounding of its entries."""
    rng = np.random.default_rng(4)
    displacement = size * rng.standard_normal(30)
    difference = 1e-3 * size * rng.standard_normal(30)
    jacobian = rng.standard_normal((30, 3, 2))
    gram = FactoredSensitivities.of(
        [{0: displacement}, {0: displacement, 1: difference}],
        jacobian,
        np.arange(30),
        30,
    ).gram()
    squared_norm = gram[1, 1] - 2 * gram[0, 1] + gram[0, 0]
    assert squared_norm == pytest.approx(
        (difference**2 * (jacobian[..., 1] ** 2).sum(axis=1)).sum(), rel=1e-8
    )


def assert_slopes(model, estimate, observations, shape):
    """Check that sensitivities are central differences of the residuals, and that
    every parameter has an effect."""
    conditions = evaluate_conditions(model, estimate, observations.states)
    steps = np.diag(small_steps(model, estimate))
    expected = slopes(model, estimate, observations, conditions, steps)
    linearized = linearize(model, estimate, observations, conditions)
    sensitivities = linearized.sensitivities @ steps
    largest = np.abs(expected).max(axis=(0, 1))
    assert expected.shape == (*shape, len(list_parameters(model, estimate)))
    assert sensitivities.shape == expected.shape
    assert (largest > 0).all()
    np.testing.assert_allclose(
        sensitivities / largest, expected / largest, rtol=0, atol=1e-5
    )


def test_sensitivities_are_central_differences_of_the_residuals(full_case):
    assert_slopes(*full_case, (24, full_case[0].rows))


def test_mounts_with_an_unknown_rotation_or_an_unknown_offset_have_sensitivities(
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


def test_the_instant_of_a_jump_has_no_slope_if_a_row_is_within_a_step_of_it(fanuc):
    model = make_model(fanuc.chain, effects=[find_candidate(fanuc.chain, "setup_step")])
    states = make_states(6, 9, seed=3)
    observations = observe_exactly(model, make_estimate(model, seed=4), states)
    # A step further, the row at a half lies on the other side of the jump.
    estimate = replace(make_estimate(model, seed=5), shapes=(np.array([0.5 - 1e-6]),))
    conditions = evaluate_conditions(model, estimate, states)
    linearized = linearize(model, estimate, observations, conditions)
    assert not linearized.sensitivities[..., -1].any()
    assert linearized.sensitivities[..., -2].any()
    fit = fit_model(model, observations, NOISE, estimate)
    assert fit.unidentifiable[-1]
    assert fit.estimate.shapes[0] == estimate.shapes[0]
    assert fit.converged
