"""Whitening: against a dense Cholesky factor of the whole covariance, and on simulated noise."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import made_estimate, made_model, made_states, seen_exactly

from elastocal.campaigns.campaign import Target
from elastocal.fitting.linearization import linearize
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import whitening
from elastocal.fitting.observations import Observations
from elastocal.fitting.prediction import conditions

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
    jacobian = linearize(model, estimate, seen, conditions(model, estimate, states)).coordinate_jacobian[..., :6]
    return seen, jacobian


def dense_covariance(seen, jacobian, noise):
    """Covariance of all rows, written out from what the noise means."""
    rows = seen.rows
    joints, common = jacobian.reshape(-1, 6) * noise.joint_rad, jacobian.reshape(-1, 6) * noise.pose_rad
    state, pose = np.repeat(seen.state, rows), np.repeat(seen.cluster, rows)
    sensor = np.tile(([noise.position_m] * 3 + [noise.orientation_rad] * 3)[:rows], len(seen))
    if seen.position_std is not None:
        of_positions = np.tile(np.arange(rows) < 3, len(seen))
        sensor = sensor * np.where(of_positions, np.repeat(seen.position_std, rows) / noise.usual_m, 1.0)
    one = (joints @ joints.T) * (state[:, None] == state) + np.diag(sensor**2)
    # What a pose has in common no repeat averages.
    return one / seen.states.repeats[state] + (common @ common.T) * (pose[:, None] == pose)


@pytest.mark.parametrize("stated", [False, True], ids=["alike", "each of its own"])
@pytest.mark.parametrize("pose_rad", [0.0, 2e-5, 1e-3])
def test_whitened_rows_are_those_of_a_dense_cholesky_factor(case, pose_rad, stated):
    """Poses of one state and of three, which share an error of the joints where there is one."""
    seen, jacobian = case
    seen = replace(seen, states=replace(seen.states, pose=np.array([0, 1, 1, 1, 2, 2, 3])))
    noise = replace(NOISE, pose_rad=pose_rad)
    if stated:
        seen = replace(seen, position_std=np.random.default_rng(3).uniform(2e-5, 3e-4, len(seen)))
        noise = replace(noise, usual_m=1e-4)
    covariance = dense_covariance(seen, jacobian, noise)
    values = np.random.default_rng(2).standard_normal((len(seen), seen.rows, 5))
    found = whitening(seen, jacobian, noise).apply(values).reshape(-1, 5)
    # A factor of a covariance is unique but for the order of its rows: what is whitened has the same products.
    expected = values.reshape(-1, 5).T @ np.linalg.solve(covariance, values.reshape(-1, 5))
    np.testing.assert_allclose(found.T @ found, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())
    identity = np.eye(len(covariance)).reshape(len(seen), seen.rows, -1)
    factor = whitening(seen, jacobian, noise).apply(identity).reshape(covariance.shape)
    np.testing.assert_allclose(factor @ covariance @ factor.T, np.eye(len(covariance)), atol=1e-7)


@pytest.mark.parametrize("noise", [NOISE, replace(NOISE, joint_rad=np.zeros(6)), replace(NOISE, pose_rad=1e-4)])
def test_a_whitening_after_matrices_is_that_of_what_these_make(case, noise):
    seen, jacobian = case
    rng = np.random.default_rng(7)
    maps = rng.standard_normal((len(seen), seen.rows, seen.rows))
    values = rng.standard_normal((len(seen), seen.rows, 3))
    by = whitening(seen, jacobian, noise)
    np.testing.assert_allclose(by.after(maps).apply(values), by.apply(maps @ values), rtol=1e-8, atol=1e-6)
