"""Equations 5-10: tubes by an independent integration of the beam, torques by virtual
work, the regressor, and its limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from support import random_loads

from elastocal.mechanics.elastostatics import (
    build_regressor,
    compute_generalized_forces,
    compute_joint_torques,
    compute_offset_wrench,
    compute_tube_compliance,
)
from elastocal.mechanics.kinematics import compute_poses, compute_poses_and_jacobians
from elastocal.mechanics.robot import Tube
from elastocal.study.simulation import compute_true_deflections


def test_offset_that_turns_with_the_tool_loads_the_joints_as_a_force_at_that_target(
    robot,
):
    loads = random_loads(robot, 2, 4)
    force = loads.wrench[..., :3]
    end = robot.chain.end_effector
    target = replace(end, offset_m=(0.0, 0.5, 0.0))
    rotation = compute_poses(robot.chain, loads.joint_angles, end)[1]
    at_end = compute_offset_wrench(force, target.offset_m, rotation)
    at_target = np.concatenate([force, np.zeros_like(force)], axis=-1)
    np.testing.assert_allclose(
        compute_joint_torques(robot.chain, loads.joint_angles, at_end, end),
        compute_joint_torques(robot.chain, loads.joint_angles, at_target, target),
        rtol=0,
        atol=1e-9,
    )


def test_deflections_are_those_of_the_cartesian_stiffness_of_equation_6(kuka):
    """The study needs only its inverse, equation 8: the stiffness K = (J C J^T)^-1 gives
    the wrench back from the exact deflection, under forces that are small enough."""
    loads = random_loads(kuka, 1, 20, force=0.01)
    end = kuka.chain.end_effector
    deflection = compute_true_deflections(kuka, loads, end, "end_effector")
    jacobian = compute_poses_and_jacobians(kuka.chain, loads.joint_angles, end)[2]
    compliance = (jacobian * kuka.compliance) @ np.swapaxes(jacobian, -1, -2)
    stiffness = np.linalg.inv(compliance)
    wrench = (stiffness @ deflection[..., None])[..., 0]
    np.testing.assert_allclose(wrench, loads.wrench, rtol=0, atol=1e-4)


def test_regressor_has_the_columns_of_equation_10(kuka):
    loads = random_loads(kuka, 1, 3)
    jacobian = compute_poses_and_jacobians(
        kuka.chain, loads.joint_angles, kuka.chain.end_effector
    )[2]
    matrix = build_regressor(
        jacobian, compute_generalized_forces(jacobian, loads.wrench)
    )
    in_place = jacobian.copy()
    assert (
        build_regressor(
            in_place, compute_generalized_forces(in_place, loads.wrench), out=in_place
        )
        is in_place
    )
    np.testing.assert_array_equal(in_place, matrix)
    for index in np.ndindex(1, 3):
        columns = [
            np.outer(column, column) @ loads.wrench[index]
            for column in jacobian[index].T
        ]
        np.testing.assert_allclose(
            matrix[index], np.column_stack(columns), rtol=1e-12, atol=1e-9
        )


TUBE = Tube(0.25, 0.02, 70e9, 26e9)


def integrated_beam(tube, vector):
    """Tip compliance of a round cantilever along a vector, summed over its slices."""
    length = np.linalg.norm(vector)
    direction = np.array(vector) / length
    outer = tube.outer_diameter_m / 2
    inner = outer - tube.wall_m
    area = quad(lambda r: 2 * np.pi * r, inner, outer)[0]
    polar = quad(lambda r: 2 * np.pi * r**3, inner, outer)[0]
    axial = np.outer(direction, direction)
    # A slice stretches along the beam, twists about it and bends about the other axes.
    slice_compliance = np.zeros((6, 6))
    slice_compliance[:3, :3] = axial / (tube.youngs_modulus_Pa * area)
    slice_compliance[3:, 3:] = axial / (tube.shear_modulus_Pa * polar)
    slice_compliance[3:, 3:] += (np.eye(3) - axial) / (
        tube.youngs_modulus_Pa * polar / 2
    )
    compliance = np.zeros((6, 6))
    # Four nodes are exact up to degree seven; the integrand has degree two.
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for node, weight in zip(nodes, weights, strict=True):
        x, y, z = 0.5 * (1 - node) * length * direction  # from the slice to the tip
        # A slice that stretches by s and turns by t moves the tip by s + t x lever and
        # turns it by t.
        motion = np.eye(6)
        motion[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
        compliance += 0.5 * weight * length * motion @ slice_compliance @ motion.T
    return compliance


@pytest.mark.parametrize(
    "tube", [TUBE, Tube(0.1, 0.05, 210e9, 80e9), Tube(0.3, 0.001, 70e9, 26e9)]
)
@pytest.mark.parametrize("length", [0.1, 1.2])
def test_tube_compliance_is_that_of_an_integrated_beam(tube, length):
    expected = integrated_beam(tube, [length, 0.0, 0.0])
    np.testing.assert_allclose(
        compute_tube_compliance(tube, length),
        expected,
        rtol=1e-10,
        atol=1e-12 * np.abs(expected).max(),
    )


def test_extended_deflection_is_that_of_joints_and_beams_added_up(kuka_extended):
    loads = random_loads(kuka_extended, 1, 5, force=1.0)
    point = kuka_extended.chain.end_effector
    deflection = compute_true_deflections(kuka_extended, loads, point, "end_effector")
    expected = compute_true_deflections(
        replace(kuka_extended, links=()), loads, point, "end_effector"
    )
    end = compute_poses(kuka_extended.chain, loads.joint_angles, point)[0]
    for link in kuka_extended.links:
        position, rotation = compute_poses(
            kuka_extended.chain, loads.joint_angles, replace(point, after=link.after)
        )
        for index in np.ndindex(1, 5):
            axes = np.kron(np.eye(2), rotation[index])
            lever = end[index] - position[index]
            force = loads.wrench[index][:3]
            moment = loads.wrench[index][3:]
            bend = integrated_beam(link.tube, link.vector_m)
            tip = (
                axes
                @ bend
                @ axes.T
                @ np.concatenate([force, moment + np.cross(lever, force)])
            )
            expected[index] += np.concatenate(
                [tip[:3] + np.cross(tip[3:], lever), tip[3:]]
            )
    # With one newton, second-order terms are below 1e-11 m; differences of poses have
    # rounding errors of 1e-15 m.
    np.testing.assert_allclose(deflection, expected, rtol=0, atol=2e-11)
    assert np.abs(expected).max() > 1e-7
