"""Whitening: against a dense Cholesky factor of the whole covariance, and on simulated noise."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.campaign import Target
from elastocal.model import circumstances, linearize
from elastocal.noise import Noise
from elastocal.observations import Observations
from elastocal.whitening import spectrum, whitening

TARGETS = tuple(Target(name, point, (0.1, 0.05, 0.0)) for name, point in (("A", "6DoF"), ("B", "3DoF"), ("C", "2DoF")))
NOISE = Noise("repeats", 60e-6, 40e-6, 1e-6 * np.array([30.0, 40, 50, 60, 70, 0]))


@pytest.fixture(params=[3, 6], ids=["positions", "poses"])
def case(request, fanuc):
    """Observations of one to three targets a state, averaged over one to four repeats, and their Jacobian."""
    model = made_model(fanuc.chain, TARGETS, request.param, fitted_frames=False)
    states = made_states(6, 7, seed=1)
    states.repeats[:] = [1, 4, 2, 3, 1, 2, 4]
    whole = seen_exactly(model, made_estimate(model), states)
    kept = np.array([0, 1, 2, 4, 6, 7, 8, 9, 12, 13, 14, 17, 18, 19, 20])
    rotation = None if whole.rotation is None else whole.rotation[kept]
    seen = Observations(states, whole.state[kept], whole.target[kept], whole.position[kept], rotation)
    estimate = made_estimate(model)
    jacobian = linearize(model, estimate, seen, circumstances(model, estimate, states)).coordinate_jacobian[..., :6]
    return seen, jacobian


def dense_covariance(seen, jacobian, noise, discrepancy):
    """Covariance of all rows, written out from what the noise means."""
    rows = seen.rows
    joints = jacobian.reshape(-1, 6) * noise.joint_rad
    state = np.repeat(seen.state, rows)
    together = state[:, None] == state
    share = noise.orientation_rad / noise.position_m
    sensor = np.tile(([noise.position_m] * 3 + [noise.orientation_rad] * 3)[:rows], len(seen))
    lacking = np.tile(([discrepancy] * 3 + [discrepancy * share] * 3)[:rows], len(seen))
    one = (joints @ joints.T) * together + np.diag(sensor**2)
    return one / seen.states.repeats[state] + np.diag(lacking**2)


@pytest.mark.parametrize("discrepancy", [0.0, 2e-4])
def test_whitened_rows_are_those_of_a_dense_cholesky_factor(case, discrepancy):
    seen, jacobian = case
    factor = np.linalg.cholesky(dense_covariance(seen, jacobian, NOISE, discrepancy))
    values = np.random.default_rng(2).standard_normal((len(seen), seen.rows, 5))
    found = whitening(seen, jacobian, NOISE, discrepancy).apply(values)
    expected = np.linalg.solve(factor, values.reshape(-1, 5)).reshape(values.shape)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


def test_rows_of_one_and_of_many_columns_are_whitened_alike(case):
    seen, jacobian = case
    values = np.random.default_rng(3).standard_normal((len(seen), seen.rows, 2, 3))
    by = whitening(seen, jacobian, NOISE)
    found = by.apply(values)
    np.testing.assert_allclose(by.apply(values[:, :, 1, 2]), found[:, :, 1, 2], rtol=1e-12)


def test_whitened_simulated_noise_is_independent_and_of_unit_variance(case):
    seen, jacobian = case
    rng, draws = np.random.default_rng(4), 8000
    total = np.zeros((len(seen), seen.rows, draws))
    sensor = np.array([NOISE.position_m] * 3 + [NOISE.orientation_rad] * 3)[: seen.rows]
    for repeat in range(4):
        there = repeat < seen.states.repeats[seen.state]
        joints = NOISE.joint_rad[:, None] * rng.standard_normal((7, 6, draws))
        noise = jacobian @ joints[seen.state] + sensor[:, None] * rng.standard_normal(total.shape)
        total += there[:, None, None] * noise
    mean = total / seen.states.repeats[seen.state][:, None, None]
    white = whitening(seen, jacobian, NOISE).apply(mean).reshape(-1, draws)
    covariance = white @ white.T / draws
    # Each entry has a standard error of 1 / sqrt(draws), on the diagonal sqrt(2) times that.
    np.testing.assert_allclose(covariance, np.eye(len(white)), rtol=0, atol=6 * np.sqrt(2 / draws))


def test_sensor_alone_only_divides(case):
    seen, jacobian = case
    values = np.random.default_rng(5).standard_normal((len(seen), seen.rows))
    found = whitening(seen, jacobian, replace(NOISE, joint_rad=np.zeros(6))).apply(values)
    deviation = np.array([60e-6] * 3 + [40e-6] * 3)[: seen.rows]
    expected = values / deviation * np.sqrt(seen.states.repeats[seen.state])[:, None]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_discrepancy_is_not_averaged_by_repeats(case):
    seen, jacobian = case
    by = whitening(seen, jacobian, replace(NOISE, position_m=1e-9, orientation_rad=1e-9, joint_rad=np.zeros(6)), 1e-4)
    np.testing.assert_allclose(by.apply(np.full((len(seen), seen.rows), 1e-4)), 1.0, rtol=1e-6)


@pytest.mark.parametrize("discrepancy", [0.0, 30e-6, 2e-3])
def test_spectrum_gives_the_whitened_square_for_every_discrepancy(case, discrepancy):
    seen, jacobian = case
    values = np.random.default_rng(8).normal(0, 1e-4, (len(seen), seen.rows))
    variances, squares = spectrum(seen, jacobian, NOISE, values)
    whitened = whitening(seen, jacobian, NOISE, discrepancy).apply(values)
    np.testing.assert_allclose((squares / (variances + discrepancy**2)).sum(), (whitened**2).sum(), rtol=1e-10)
