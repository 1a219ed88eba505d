"""Equations 6-10: torques by virtual work, wrench transport, the regressor, and how far the linear model goes."""

from dataclasses import replace

import numpy as np
import pytest
from support import OTHER_CHAINS, chain_of, random_angles, random_loads

from elastocal.mechanics.elastostatics import (
    exact_deflections,
    generalized_forces,
    joint_torques,
    regressor,
    wrench_of_offset_force,
)
from elastocal.mechanics.kinematics import poses, poses_and_jacobians
from elastocal.mechanics.pose_differences import pose_differences


@pytest.mark.parametrize("name", ["kuka", *OTHER_CHAINS])
def test_torques_do_the_work_of_the_wrench(name, request):
    chain = chain_of(OTHER_CHAINS[name]) if name in OTHER_CHAINS else request.getfixturevalue(name).chain
    rng = np.random.default_rng(1)
    angles, wrench = random_angles(rng, chain, 5), rng.uniform(-1000, 1000, (5, 6))
    rate, step = rng.uniform(-1, 1, chain.coordinates), 1e-5
    for point in chain.points:
        ahead, behind = poses(chain, angles + step * rate, point), poses(chain, angles - step * rate, point)
        work = (wrench * pose_differences(*ahead, *behind)).sum(axis=-1) / (2 * step)
        torques = joint_torques(chain, angles, wrench, point)
        # 1e3 N times the 1e-8 m of a central difference along up to seven joints at once.
        np.testing.assert_allclose(torques @ rate, work, rtol=0, atol=1e-5)


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


def test_untransported_wrench_gives_other_torques_at_a_partial_point(kuka):
    loads = random_loads(kuka, 1, 4)
    torques = joint_torques(kuka.chain, loads.joint_angles, loads.wrench, kuka.chain.end_effector)
    partial = joint_torques(kuka.chain, loads.joint_angles, loads.wrench, kuka.chain.point("2DoF"))
    assert np.abs(partial - torques)[..., :2].max() > 100.0


def test_force_with_an_offset_along_base_axes_is_that_force_transported():
    rng = np.random.default_rng(3)
    force, offset = rng.standard_normal((4, 5, 3)), np.array([0.1, 0.5, -0.2])
    at_point = np.concatenate([force, np.zeros_like(force)], axis=-1)
    expected = transported(at_point, offset, np.zeros(3))
    np.testing.assert_allclose(wrench_of_offset_force(force, offset), expected, rtol=0, atol=1e-15)


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


def test_regressor_times_compliance_is_the_deflection_of_equation_8(robot):
    loads = random_loads(robot, 2, 3)
    stiffness = np.diag(1.0 / robot.compliance)
    for point in robot.chain.points:
        jacobian = poses_and_jacobians(robot.chain, loads.joint_angles, point)[2]
        end = poses_and_jacobians(robot.chain, loads.joint_angles, robot.chain.end_effector)[2]
        torques = joint_torques(robot.chain, loads.joint_angles, loads.wrench, robot.chain.end_effector)
        matrix = regressor(jacobian, torques)
        for index in np.ndindex(2, 3):
            springs = np.linalg.solve(stiffness, end[index].T @ loads.wrench[index])
            np.testing.assert_allclose(matrix[index] @ robot.compliance, jacobian[index] @ springs, rtol=1e-12, atol=1e-16)


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


def test_deflection_times_cartesian_stiffness_is_the_wrench(kuka):
    # Equation 6; six joints make the Jacobian square, so the Cartesian stiffness exists away from singularities.
    loads = random_loads(kuka, 1, 5, seed=4)
    jacobian = poses_and_jacobians(kuka.chain, loads.joint_angles, kuka.chain.end_effector)[2]
    matrix = regressor(jacobian, generalized_forces(jacobian, loads.wrench))
    for index in np.ndindex(1, 5):
        stiffness = np.linalg.inv(jacobian[index] @ np.diag(kuka.compliance) @ jacobian[index].T)
        np.testing.assert_allclose(stiffness @ matrix[index] @ kuka.compliance, loads.wrench[index], rtol=0, atol=1e-6)


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


def test_no_spring_deflection_is_no_deflection(kuka):
    angles = random_angles(np.random.default_rng(5), kuka.chain, 3)
    assert not exact_deflections(kuka.chain, angles, np.zeros(6), kuka.chain.end_effector).any()


def test_exact_deflection_of_one_joint_is_a_turn_about_its_axis():
    chain = chain_of("Rz(q1) Tx(2) [EE]")
    found = exact_deflections(chain, np.zeros(1), np.array([0.3]), chain.end_effector)
    expected = [2 * np.cos(0.3) - 2, 2 * np.sin(0.3), 0.0, 0.0, 0.0, 0.3]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)
