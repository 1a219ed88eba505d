"""Equation 6 against finite differences and against the equilibrium of the loaded arm."""

import numpy as np
import pytest
from made_studies import few_of
from made_study_blocks import experiments_of

from elastocal.mechanics.elastostatics import generalized_forces, joint_torques
from elastocal.mechanics.kinematics import jacobians
from elastocal.study.simulation import to_experiments
from elastocal.study.stiffness import equilibrium, stiffness_columns, torque_gradient


@pytest.fixture
def loaded(kuka):
    drawn = to_experiments(experiments_of(kuka, 1, 5)[0])
    angles, wrench = drawn.joint_angles[0], drawn.wrench[0]
    return angles, wrench, jacobians(kuka.chain, angles, kuka.chain.end_effector)


def test_the_gradient_of_torques_is_that_of_finite_differences(kuka, loaded):
    angles, wrench, jacobian = loaded
    found, step = torque_gradient(jacobian, wrench), 1e-6
    for joint in range(6):
        moved = [
            generalized_forces(jacobians(kuka.chain, angles + sign * step * np.eye(6)[joint], kuka.chain.end_effector), wrench)
            for sign in (1, -1)
        ]
        np.testing.assert_allclose(found[..., joint], (moved[0] - moved[1]) / (2 * step), atol=1e-5)


def test_torques_in_equilibrium_are_those_of_the_loaded_arm(kuka, loaded):
    angles, wrench, jacobian = loaded
    end = kuka.chain.end_effector
    theta = equilibrium(kuka, angles, wrench, end)
    np.testing.assert_allclose(theta, kuka.compliance * joint_torques(kuka.chain, angles + theta, wrench, end), rtol=1e-10)
    # The linearised springs of the loaded arm come closer to it than those of the unloaded one.
    plain = kuka.compliance * generalized_forces(jacobian, wrench)
    springs = np.linalg.inv(np.diag(1 / kuka.compliance) - torque_gradient(jacobian, wrench))
    linear = (springs @ generalized_forces(jacobian, wrench)[..., None])[..., 0]
    assert np.abs(linear - theta).max() < 0.05 * np.abs(plain - theta).max()


def test_the_effect_of_the_loaded_arm_grows_with_the_load(kuka):
    found = stiffness_columns(few_of(kuka), [1000.0, 3000.0])
    for name in ("first_order", "by_k_c", "loaded", "bias"):
        assert 2.9 < found[name][1] / found[name][0] < 3.1, name
        assert 0 < found[name][0] < 1.0
    assert found["offset_rank"].tolist() == [5, 5] and found["rank"].tolist() == [6, 6]
