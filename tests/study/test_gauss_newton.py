"""Identification on the exact kinematics: exact where equation 11 is linear, and indifferent to where it starts."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from support import random_loads, without_tool

from elastocal.mechanics.elastostatics import exact_deflections, joint_torques, regressor
from elastocal.mechanics.kinematics import poses_and_jacobians
from elastocal.mechanics.robot import with_target_offset
from elastocal.study import gauss_newton
from elastocal.study.equation_11 import Measurements, first_solvable_length, identify
from elastocal.study.gauss_newton import identify_exactly
from elastocal.study.simulation import true_deflections

SETS, CONFIGURATIONS = 3, 4


class Data:
    """Exact deflections, configuration before data set, with or without noise."""

    def __init__(self, robot, noise=0.0, rows=6, force=1000.0, sets=SETS):
        self.robot, self.chain, rng = robot, robot.chain, np.random.default_rng(1)
        loads = random_loads(robot, sets, CONFIGURATIONS, seed=2, force=force)
        self.joint_angles = np.swapaxes(loads.joint_angles, 0, 1)
        end = without_tool(robot.chain.end_effector)
        torques = np.swapaxes(joint_torques(robot.chain, loads.joint_angles, loads.wrench, end), 0, 1)
        self.torques = {point.name: torques for point in robot.chain.points}
        self.deflections = {}
        for point in robot.chain.points:
            deflection = np.swapaxes(true_deflections(robot, loads, point, "end_effector"), 0, 1)[..., :rows]
            self.deflections[point.name] = deflection + noise * rng.standard_normal(deflection.shape)

    def solved(self, strategy, lengths=(CONFIGURATIONS,), start=None):
        start = np.full(self.robot.joints, 1e-6) if start is None else start
        return identify_exactly(strategy, self.chain, self.joint_angles, self.torques, self.deflections, start, lengths)

    def linear(self, strategy):
        measurements = {}
        for point in self.chain.points:
            jacobian = poses_and_jacobians(self.chain, self.joint_angles, point)[2]
            matrix = np.moveaxis(regressor(jacobian, self.torques[point.name]), (-2, -1), (0, 1))
            deflection = np.moveaxis(self.deflections[point.name], -1, 0)
            measurements[point.name] = Measurements(matrix[: len(deflection)], deflection)
        return identify(strategy, measurements, self.robot.joints)[0][-1]


def find_distance(found, robot):
    return np.abs(found / robot.compliance[:, None] - 1).max()


def test_true_compliances_are_recovered_where_equation_11_is_off(robot, strategies):
    data = Data(robot)
    for strategy in strategies.values():
        lengths = range(first_solvable_length(strategy, 6), CONFIGURATIONS + 1)
        found = data.solved(strategy, lengths)
        assert found.shape == (len(lengths), 6, SETS)
        # Differences of poses round at 1e-15 m, a thousand-millionth of a deflection is 1e-12 m; one configuration alone is
        # ill-conditioned by up to 1e4.
        assert max(find_distance(one, robot) for one in found[1:]) < 1e-9 and find_distance(found[0], robot) < 1e-8
        assert find_distance(data.linear(strategy), robot) > 1e-5


def test_noisy_estimates_are_those_of_a_general_least_squares_solver(kuka, strategies):
    data = Data(kuka, noise=2e-4)
    found = data.solved(strategies["3+6DoF-comb"])[0]
    for s in range(SETS):

        def residuals(scaled, s=s):
            left = []
            for name in ("3DoF", "6DoF"):
                springs = 1e-6 * scaled * data.torques[name][:, s]
                predicted = exact_deflections(data.chain, data.joint_angles[:, s], springs, data.chain.point(name))
                left.append((predicted - data.deflections[name][:, s]).ravel())
            return 1e3 * np.concatenate(left)

        solved = least_squares(residuals, np.ones(6), jac="3-point", xtol=1e-14, ftol=1e-14, gtol=1e-14).x
        # The solver differentiates numerically, and its minimum is flat in the square.
        np.testing.assert_allclose(1e6 * found[:, s], solved, rtol=0, atol=1e-5)


def test_positions_of_a_target_off_the_axis_give_every_joint(robot, strategies):
    data = Data(with_target_offset(robot, (0.1, 0.05, 0.2)), rows=3)
    for strategy in strategies.values():
        assert find_distance(data.solved(strategy)[0], robot) < 1e-8


@pytest.mark.parametrize("force", [1000.0, 10.0])
def test_one_ill_conditioned_data_set_does_not_take_the_others_along(kuka, strategies, force):
    # One configuration each: the worst of 200 is so ill-conditioned that rounding alone keeps its steps above 1e-10.
    data = Data(kuka, force=force, sets=200)
    found = data.solved(strategies["6DoF"], (1,))[0]
    errors = np.abs(found / kuka.compliance[:, None] - 1).max(axis=0)
    assert (errors < 1e-5).mean() > 0.95


def test_steps_that_do_not_settle_leave_no_number(kuka, strategies, monkeypatch):
    monkeypatch.setattr(gauss_newton, "STEPS", 1)
    assert np.isnan(Data(kuka).solved(strategies["6DoF"])).all()
