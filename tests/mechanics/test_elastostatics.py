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


def test_columns_of_the_regressor_are_those_of_equation_10(kuka):
    loads = random_loads(kuka, 1, 3)
    jacobian = compute_poses_and_jacobians(
        kuka.chain, loads.joint_angles, kuka.chain.end_effector
    )[2]
    matrix = build_regressor(
        jacobian, compute_generalized_forces(jacobian, loads.wrench)
    )
    inside = jacobian.copy()
    assert (
        build_regressor(
            inside, compute_generalized_forces(inside, loads.wrench), out=inside
        )
        is inside
    )
    np.testing.assert_array_equal(inside, matrix)
    for index in np.ndindex(1, 3):
        columns = [
            np.outer(column, column) @ loads.wrench[index]
            for column in jacobian[index].T
        ]
        np.testing.assert_allclose(
            matrix[index], np.column_stack(columns), rtol=1e-12, atol=1e-9
        )


TUBE = Tube(0.25, 0.02, 70e9, 26e9)


def integrated_beam(tube, along):
    """Tip compliance of a round cantilever that runs along a vector, by adding up what
    each slice gives way."""
    length = np.linalg.norm(along)
    direction = np.array(along) / np.linalg.norm(along)
    outer = tube.outer_diameter_m / 2
    inner = outer - tube.wall_m
    area = quad(lambda r: 2 * np.pi * r, inner, outer)[0]
    polar = quad(lambda r: 2 * np.pi * r**3, inner, outer)[0]
    second = polar / 2
    axial = np.outer(direction, direction)
    stretch = axial / (tube.youngs_modulus_Pa * area)
    turn = axial / (tube.shear_modulus_Pa * polar) + (np.eye(3) - axial) / (
        tube.youngs_modulus_Pa * second
    )
    total = np.zeros((6, 6))
    nodes, weights = np.polynomial.legendre.leggauss(
        4
    )  # exact up to degree seven; the integrand is of degree two
    for node, weight in zip(nodes, weights, strict=True):
        lever = 0.5 * (1 - node) * length * direction  # from the slice to the tip
        cross = np.array(
            [
                [0, -lever[2], lever[1]],
                [lever[2], 0, -lever[0]],
                [-lever[1], lever[0], 0],
            ]
        )
        # A slice that stretches by s and turns by t moves the tip by s + t x lever and
        # turns it by t.
        moves = np.block([[np.eye(3), -cross], [np.zeros((3, 3)), np.eye(3)]])
        slice_compliance = np.block(
            [[stretch, np.zeros((3, 3))], [np.zeros((3, 3)), turn]]
        )
        total += 0.5 * weight * length * moves @ slice_compliance @ moves.T
    return total


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
    found = compute_true_deflections(kuka_extended, loads, point, "end_effector")
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
    # One newton keeps what is of second order below 1e-11 m; differences of poses round
    # at 1e-15 m.
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-11)
    assert np.abs(expected).max() > 1e-7
