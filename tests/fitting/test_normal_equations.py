"""Normal equations by central differences of the weighted squares, and in closed form where the problem is linear."""

from dataclasses import replace

import numpy as np
import pytest
from fitted_models import (
    GANTRY_NOISES,
    TARGETS,
    gantry_covariance,
    gantry_model,
    gantry_states,
    linear_law,
    model_of,
    seen_off,
    waves,
)
from synthetic import made_estimate, made_states, seen_exactly, with_noise

from elastocal.fitting.model import parameters
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import Parts
from elastocal.fitting.prediction import conditions


@pytest.mark.parametrize("pose_rad", [0.0, 3e-5])
@pytest.mark.parametrize("offset", [None, (0.0, 0.0, 0.1)])
def test_products_by_factors_are_those_of_the_columns_written_out(fanuc, offset, pose_rad, monkeypatch):
    """Targets that are fitted and that are known; errors of a state alone, and of a pose that has several."""
    targets = tuple(replace(target, offset_m=offset) for target in TARGETS)
    model = model_of(fanuc, "joint_offset@2", "lost_motion@3", "link_geometry@3", targets=targets, rows=6)
    states = replace(made_states(6, 12, seed=88), pose=np.arange(12) // 3, load=np.arange(12) % 3)
    estimate = made_estimate(model, seed=87)
    seen = with_noise(seen_exactly(model, estimate, states), np.random.default_rng(89))
    joints = 1e-6 * np.array([40.0, 15, 15, 30, 45, 220])
    noise = Noise("declared", 5e-6, 1e-5, joints, pose_rad=pose_rad)
    plausible = np.array([parameter.plausible for _, parameter in parameters(model, estimate)])
    weights, found = np.random.default_rng(90).uniform(0.3, 1.0, len(seen)), []
    for fewest in (0, 1000):
        monkeypatch.setattr("elastocal.fitting.normal_equations._COLUMNS_A_COORDINATE", fewest)
        measurements = Parts(model, seen, noise, conditions(model, estimate, seen.states), plausible)
        measurements.linearize(estimate)
        measurements.whiten()
        found.append(measurements.normal_equations(weights))
    for by_factors, written_out in zip(*found, strict=True):
        np.testing.assert_allclose(by_factors, written_out, rtol=1e-9, atol=1e-9 * np.abs(written_out).max())


@pytest.mark.parametrize("at_once", [None, 7])
@pytest.mark.parametrize("kind", GANTRY_NOISES)
def test_normal_equations_of_a_linear_problem_are_those_written_out(kind, at_once, monkeypatch):
    """Weights come before the covariance is divided out; in parts of whole poses as in one."""
    if at_once:
        monkeypatch.setattr("elastocal.fitting.displacement._MOST_HELD", 100)
        monkeypatch.setattr("elastocal.fitting.displacement._MOST_AT_ONCE", at_once)
        monkeypatch.setattr("elastocal.fitting.normal_equations.observations_at_once", lambda rows, columns: at_once)
    noise, states, plausible = GANTRY_NOISES[kind], gantry_states(20, 8), np.array([0.1, 2.0, 0.5])
    rng = np.random.default_rng(98)
    left, off, weights = waves(states.joint_angles, 3), 1e-4 * rng.standard_normal((20, 3)), rng.uniform(0.2, 1.0, 20)
    model, seen = gantry_model(linear_law(3)), seen_off(states, off)
    estimate = replace(made_estimate(model), coefficients=(np.array([1e-4, -2e-4, 3e-5]),))
    parts = Parts(model, seen, noise, conditions(model, estimate, states), plausible)
    assert len(parts.slices) == 1 if at_once is None else len(parts.slices) > 2
    parts.linearize(estimate)
    parts.whiten()
    residual = off - left @ estimate.coefficients[0]
    inverse, root = np.linalg.inv(gantry_covariance(states, noise)), np.repeat(np.sqrt(weights), 3)
    columns = root[:, None] * left.reshape(60, 3) * plausible
    gram, along = parts.normal_equations(weights)
    np.testing.assert_allclose(gram, columns.T @ inverse @ columns, rtol=1e-9)
    np.testing.assert_allclose(along, columns.T @ inverse @ (root * residual.ravel()), rtol=1e-7)
    assert parts.squares(weights) == pytest.approx((root * residual.ravel()) @ inverse @ (root * residual.ravel()), rel=1e-7)
    there = replace(estimate, coefficients=(np.array([0.0, 1e-4, 0.0]),))
    moved = root * (off - left @ there.coefficients[0]).ravel()
    assert parts.squares(weights, there) == pytest.approx(moved @ inverse @ moved, rel=1e-7)
    if kind != "poses":
        # Without an error of the pose every state is whitened by itself: its squares are those of its own covariance.
        blocks = [inverse[3 * n : 3 * n + 3, 3 * n : 3 * n + 3] for n in range(20)]
        expected = [np.sqrt(row @ block @ row / 3) for row, block in zip(residual, blocks, strict=True)]
        np.testing.assert_allclose(parts.distance(), expected, rtol=1e-7)


@pytest.mark.parametrize("poses", [5, 10])
def test_an_error_of_the_pose_counts_in_the_distances_of_a_whole_pose_together(poses):
    """Squares of all observations of a pose by the covariance of the pose: what they share is no distance of each."""
    noise, states = GANTRY_NOISES["poses"], gantry_states(20, poses)
    off = 1e-4 * np.random.default_rng(99).standard_normal((20, 3))
    model = gantry_model(linear_law(1))
    estimate = replace(made_estimate(model), coefficients=(np.zeros(1),))
    parts = Parts(model, seen_off(states, off), noise, conditions(model, estimate, states), np.ones(1))
    parts.linearize(estimate)
    parts.whiten()
    inverse = np.linalg.inv(gantry_covariance(states, noise))
    squares = off.ravel() * (inverse @ off.ravel())
    expected = np.bincount(np.repeat(states.pose, 3), squares)
    np.testing.assert_allclose(np.bincount(states.pose, 3 * parts.distance() ** 2), expected, rtol=1e-7)
