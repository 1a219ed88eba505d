"""Equations 6-10: torques by virtual work, wrench transport, the regressor, and how far the linear model goes."""

from dataclasses import replace

import numpy as np
from support import random_loads

from elastocal.mechanics.elastostatics import (
    exact_deflections,
    generalized_forces,
    joint_torques,
    regressor,
    wrench_of_offset_force,
)
from elastocal.mechanics.kinematics import poses, poses_and_jacobians


def test_generalized_forces_are_the_transposed_jacobian_times_the_wrench():
    rng = np.random.default_rng(2)
    jacobian, wrench = rng.standard_normal((4, 5, 6, 7)), rng.standard_normal((4, 5, 6))
    expected = np.stack([[jacobian[i, j].T @ wrench[i, j] for j in range(5)] for i in range(4)])
    np.testing.assert_allclose(generalized_forces(jacobian, wrench), expected, rtol=0, atol=1e-14)


def transported(wrench, from_position, to_position):
    """A wrench stated at another point of the same rigid body: M' = M + (p - p') x F."""
    force, moment = wrench[..., :3], wrench[..., 3:]
    return np.concatenate([force, moment + np.cross(from_position - to_position, force)], axis=-1)


def test_wrench_at_a_partial_point_gives_the_torques_of_the_end_effector_jacobian(robot):
    loads = random_loads(robot, 2, 4)
    end = robot.chain.end_effector
    torques = joint_torques(robot.chain, loads.joint_angles, loads.wrench, end)
    at_end = poses(robot.chain, loads.joint_angles, end)[0]
    for point in robot.chain.points:
        there = poses(robot.chain, loads.joint_angles, point)[0]
        found = joint_torques(robot.chain, loads.joint_angles, transported(loads.wrench, at_end, there), point)
        before = len(robot.chain.moved_by(point))
        np.testing.assert_allclose(found[..., :before], torques[..., :before], rtol=0, atol=1e-9)
        assert (found[..., before:] == 0).all()


def test_offset_that_turns_with_the_tool_loads_the_joints_as_a_force_at_that_target(robot):
    loads = random_loads(robot, 2, 4)
    force, end = loads.wrench[..., :3], robot.chain.end_effector
    target = replace(end, offset_m=(0.0, 0.5, 0.0))
    rotation = poses(robot.chain, loads.joint_angles, end)[1]
    at_end = wrench_of_offset_force(force, target.offset_m, rotation)
    at_target = np.concatenate([force, np.zeros_like(force)], axis=-1)
    np.testing.assert_allclose(
        joint_torques(robot.chain, loads.joint_angles, at_end, end),
        joint_torques(robot.chain, loads.joint_angles, at_target, target),
        rtol=0,
        atol=1e-9,
    )


def test_columns_of_the_regressor_are_those_of_equation_10(kuka):
    loads = random_loads(kuka, 1, 3)
    jacobian = poses_and_jacobians(kuka.chain, loads.joint_angles, kuka.chain.end_effector)[2]
    matrix = regressor(jacobian, generalized_forces(jacobian, loads.wrench))
    inside = jacobian.copy()
    assert regressor(inside, generalized_forces(inside, loads.wrench), out=inside) is inside
    np.testing.assert_array_equal(inside, matrix)
    for index in np.ndindex(1, 3):
        columns = [np.outer(column, column) @ loads.wrench[index] for column in jacobian[index].T]
        np.testing.assert_allclose(matrix[index], np.column_stack(columns), rtol=1e-12, atol=1e-9)


def test_exact_deflection_departs_from_the_linear_one_in_second_order(robot):
    loads = random_loads(robot, 2, 5)
    for point in robot.chain.points:
        jacobian = poses_and_jacobians(robot.chain, loads.joint_angles, point)[2]
        torques = joint_torques(robot.chain, loads.joint_angles, loads.wrench, robot.chain.end_effector)
        beyond = []
        for share in (1.0, 0.5):
            springs = share * robot.compliance * torques
            linear = (jacobian * springs[..., None, :]).sum(axis=-1)
            beyond.append(exact_deflections(robot.chain, loads.joint_angles, springs, point) - linear)
        # Springs turn by some 1e-3 rad: second order is some nanometres to micrometres, third a thousandth of that.
        assert np.abs(beyond[0]).max() > 1e-8
        assert np.linalg.norm(beyond[0] - 4 * beyond[1]) < 0.01 * np.linalg.norm(beyond[0])
