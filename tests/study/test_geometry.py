"""Geometry and elasticity together: closed forms against simulated estimates and finite differences."""

import numpy as np
import pytest

from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import poses
from elastocal.study.geometry import (
    AT_ONCE,
    DIFFERENCES,
    IN_TURN,
    NO_ELASTICITY,
    NO_GEOMETRY,
    geometry_columns,
    qualities,
)

NOISE = 1e-3


@pytest.fixture(scope="module")
def made():
    """Random columns of 4 geometric parameters and 2 compliances in 12 rows, two data sets, and their qualities."""
    rng = np.random.default_rng(1)
    geometry, elasticity = rng.standard_normal((2, 12, 4)), rng.standard_normal((2, 12, 2))
    root = rng.standard_normal((9, 6))
    compliance, std, moment = np.array([0.5, 0.2]), np.array([0.1, 0.2, 0.1, 0.3]), root.T @ root
    return geometry, elasticity, compliance, std, moment, qualities(geometry, elasticity, NOISE, compliance, std, moment)


def test_columns_are_derivatives_by_joint_angles_and_lengths():
    text, lengths = "Tz(l1) Rz(q1) Tx(l2) Ry(q2) Tx(l3) [6DoF]", {"l1": 0.6, "l2": 0.3, "l3": 0.8}
    chain, angles = parse_chain(text, lengths, "x"), np.array([[0.3, -0.7]])
    columns = geometry_columns(chain, angles)[0]
    assert columns.shape == (6, 5)
    for place, name in enumerate(lengths):
        sides = [
            poses(changed, angles, changed.end_effector)[0][0]
            for changed in (parse_chain(text, lengths | {name: lengths[name] + step}, "x") for step in (1e-5, -1e-5))
        ]
        np.testing.assert_allclose(columns[:3, 2 + place], (sides[0] - sides[1]) / 2e-5, atol=1e-8)
    for joint in range(2):
        sides = [poses(chain, angles + step * np.eye(2)[joint], chain.end_effector)[0][0] for step in (1e-5, -1e-5)]
        np.testing.assert_allclose(columns[:3, joint], (sides[0] - sides[1]) / 2e-5, atol=1e-8)


def test_at_once_is_best_and_differences_have_twice_the_variance(made):
    geometry, elasticity, compliance, *_, found = made
    assert found[AT_ONCE].noise <= found[IN_TURN].noise and found[AT_ONCE].noise <= found[DIFFERENCES].noise
    variances = [2 * NOISE**2 * np.diag(np.linalg.inv(columns.T @ columns)) for columns in elasticity]
    np.testing.assert_allclose((found[DIFFERENCES].compliance_noise * compliance) ** 2, np.mean(variances, axis=0), rtol=1e-9)
    assert geometry.shape[1] == elasticity.shape[1]


def test_leaks_are_what_simulated_fits_without_the_other_make(made):
    """Fits without noise to 4,000 robots: their mean squares have an error of 3 %."""
    geometry, elasticity, compliance, std, _, found = made
    errors = np.random.default_rng(2).standard_normal((4000, 4)) * std
    squares = []
    for G, A in zip(geometry, elasticity, strict=True):
        loaded = errors @ G.T + A @ compliance
        fitted = np.linalg.lstsq(A, loaded.T, rcond=None)[0].T
        squares.append(((fitted - compliance) ** 2).mean(axis=0))
    np.testing.assert_allclose((found[NO_GEOMETRY].compliance_leak * compliance) ** 2, np.mean(squares, axis=0), rtol=0.1)
    zeros = []
    for G, A in zip(geometry, elasticity, strict=True):
        fitted = np.linalg.lstsq(np.concatenate([G, G]), np.concatenate([np.zeros(12), A @ compliance]), rcond=None)[0]
        zeros.append(fitted[:2] ** 2)
    np.testing.assert_allclose(found[NO_ELASTICITY].zero_leak ** 2, np.mean(zeros, axis=0), rtol=1e-9)


def test_the_prediction_is_judged_with_all_that_is_wrong_together(made):
    """The leak of geometry alone: all compliances are missed, each data set has its own joint zeros."""
    geometry, elasticity, compliance, _, moment, found = made
    total = []
    for G, A in zip(geometry, elasticity, strict=True):
        fitted = np.linalg.lstsq(np.concatenate([G, G]), np.concatenate([np.zeros(12), A @ compliance]), rcond=None)[0]
        wrong = np.concatenate([fitted, -compliance])
        total.append(wrong @ moment @ wrong)
    assert found[NO_ELASTICITY].leak == pytest.approx(np.sqrt(np.mean(total)), rel=1e-9)
