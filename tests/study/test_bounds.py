"""Cramér-Rao bounds against an explicit inverse, and against the estimator that should reach them."""

import numpy as np
import pytest
from support import random_loads

from elastocal.mechanics.elastostatics import joint_torques, regressor
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.study.bounds import squared_error_bounds
from elastocal.study.identification import Measurements, identify, prefix_information
from elastocal.study.metrics import error_moment, make_judge, position_errors
from elastocal.study.simulation import true_deflections


def judge_of(robot):
    loads = random_loads(robot, 1, 50, seed=9)
    return make_judge(robot, loads, true_deflections(robot, loads, robot.chain.end_effector, "end_effector"))


def regressors(robot, configurations, names=("3DoF", "6DoF")):
    """(rows, n, configurations, 1) of one data set at each point."""
    loads, found = random_loads(robot, 1, configurations, seed=3), {}
    torques = joint_torques(robot.chain, loads.joint_angles, loads.wrench, robot.chain.end_effector)
    for name in names:
        jacobian = poses_and_jacobians(robot.chain, loads.joint_angles, robot.chain.point(name))[2]
        found[name] = np.moveaxis(regressor(jacobian, torques), (2, 3, 1, 0), (0, 1, 2, 3))
    return found


def test_bound_is_the_trace_with_the_explicit_inverse():
    rng = np.random.default_rng(1)
    rows, half = rng.standard_normal((4, 3, 9, 6)), rng.standard_normal((6, 6))
    information, moment = np.swapaxes(rows, -1, -2) @ rows, half @ half.T
    found = squared_error_bounds(information, moment)
    for index in np.ndindex(4, 3):
        assert found[index] == pytest.approx(np.trace(moment @ np.linalg.inv(information[index])), rel=1e-10)


def test_bound_is_infinite_where_the_information_is_singular_and_nowhere_else():
    rows = np.random.default_rng(2).standard_normal((2, 1, 4, 6))  # four measurements of six unknowns
    information = np.swapaxes(rows, -1, -2) @ rows
    information = np.concatenate([information, np.zeros((1, 1, 6, 6))])
    information[1, 0] = np.eye(6)
    np.testing.assert_allclose(squared_error_bounds(information, np.eye(6))[:, 0], [np.inf, 6.0, np.inf])


def test_joint_least_squares_reaches_the_bound_at_small_noise(kuka, strategies):
    # 3000 data sets of the same configurations, with other noise: their mean squared error over the bound is the efficiency.
    draws, noise, configurations = 3000, 1e-6, 6
    judge, matrices, rng = judge_of(kuka), regressors(kuka, configurations), np.random.default_rng(4)
    measurements = {}
    for name, matrix in matrices.items():
        exact = np.einsum("rnks,n->rks", matrix, kuka.compliance)
        measured = exact + noise * rng.standard_normal((6, configurations, draws))
        measurements[name] = Measurements(np.broadcast_to(matrix, (*matrix.shape[:3], draws)), measured)
    bound = squared_error_bounds(sum(prefix_information(m) for m in matrices.values()), error_moment(judge))[-1, 0]
    for name in ("3+6DoF-comb", "4-6DoF-after-6+3DoF", "4-6DoF-after-3DoF"):
        found = identify(strategies[name], measurements, 6).compliance[-1].T
        efficiency = bound * noise**2 / (position_errors(judge, found) ** 2).mean()
        if name == "4-6DoF-after-3DoF":
            assert efficiency < 0.95  # it forgets what the end-effector says of joints 1-3
        else:
            # A mean of 3000 sums of a few squares: 2 %. An efficiency of 0.9 is seen with a power of 0.97.
            assert efficiency == pytest.approx(1, abs=0.06)
