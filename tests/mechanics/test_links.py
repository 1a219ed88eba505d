"""Equation 5: tubes by an independent integration of the beam, and the extended chain against the paper's product."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from support import PinocchioPoint, homogeneous, random_loads

from elastocal.mechanics.kinematics import poses, poses_and_jacobians
from elastocal.mechanics.links import extended_chain, spring_compliance, tube_compliance
from elastocal.mechanics.robot import Tube
from elastocal.study.simulation import true_deflections

TUBE = Tube(0.25, 0.02, 70e9, 26e9)


def integrated_beam(tube, along):
    """Tip compliance of a round cantilever that runs along a vector, by adding up what each slice gives way."""
    length, direction = np.linalg.norm(along), np.array(along) / np.linalg.norm(along)
    outer = tube.outer_diameter_m / 2
    inner = outer - tube.wall_m
    area = quad(lambda r: 2 * np.pi * r, inner, outer)[0]
    polar = quad(lambda r: 2 * np.pi * r**3, inner, outer)[0]
    second = polar / 2
    axial = np.outer(direction, direction)
    stretch = axial / (tube.youngs_modulus_Pa * area)
    turn = axial / (tube.shear_modulus_Pa * polar) + (np.eye(3) - axial) / (tube.youngs_modulus_Pa * second)
    total = np.zeros((6, 6))
    nodes, weights = np.polynomial.legendre.leggauss(4)  # exact up to degree seven; the integrand is of degree two
    for node, weight in zip(nodes, weights, strict=True):
        lever = 0.5 * (1 - node) * length * direction  # from the slice to the tip
        cross = np.array([[0, -lever[2], lever[1]], [lever[2], 0, -lever[0]], [-lever[1], lever[0], 0]])
        # A slice that stretches by s and turns by t moves the tip by s + t x lever and turns it by t.
        moves = np.block([[np.eye(3), -cross], [np.zeros((3, 3)), np.eye(3)]])
        slice_compliance = np.block([[stretch, np.zeros((3, 3))], [np.zeros((3, 3)), turn]])
        total += 0.5 * weight * length * moves @ slice_compliance @ moves.T
    return total


@pytest.mark.parametrize("tube", [TUBE, Tube(0.1, 0.05, 210e9, 80e9), Tube(0.3, 0.001, 70e9, 26e9)])
@pytest.mark.parametrize("length", [0.1, 1.2])
def test_tube_compliance_is_that_of_an_integrated_beam(tube, length):
    expected = integrated_beam(tube, [length, 0.0, 0.0])
    np.testing.assert_allclose(tube_compliance(tube, length), expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())


def test_every_link_adds_its_block(kuka_extended):
    compliance = spring_compliance(kuka_extended)
    assert compliance.shape == (36, 36)
    expected = np.zeros((36, 36))
    expected[:6, :6] = np.diag(kuka_extended.compliance)
    for number, link in enumerate(kuka_extended.links):
        expected[6 + 6 * number : 12 + 6 * number, 6 + 6 * number : 12 + 6 * number] = integrated_beam(link.tube, link.vector_m)
    np.testing.assert_allclose(compliance, expected, rtol=0, atol=1e-12 * compliance.max())


def test_extended_pose_is_the_product_with_equation_5_behind_each_link(kuka_extended):
    rng = np.random.default_rng(2)
    q, theta = rng.uniform(-np.pi, np.pi, 6), rng.uniform(-0.2, 0.2, (5, 6))

    def spring(number):
        kinds = zip("TTTRRR", (0, 1, 2, 0, 1, 2), theta[number], strict=True)
        product = np.eye(4)
        for kind, axis, amount in kinds:
            product = product @ homogeneous(kind, axis, amount)
        return product

    x, y, z = range(3)
    base = homogeneous("T", z, 0.675) @ spring(0) @ homogeneous("R", z, q[0])
    t_2 = base @ homogeneous("T", x, 0.35) @ spring(1) @ homogeneous("R", y, q[1]) @ homogeneous("T", x, 1.15) @ spring(2)
    t_3 = t_2 @ homogeneous("R", y, q[2]) @ homogeneous("T", z, -0.041) @ homogeneous("T", x, 1.2) @ spring(3)
    t_4 = t_3 @ homogeneous("R", x, q[3])
    t_full = t_4 @ homogeneous("R", y, q[4]) @ homogeneous("R", x, q[5]) @ homogeneous("T", x, 0.24) @ spring(4)
    chain = extended_chain(kuka_extended)
    coordinates = np.concatenate([q, theta.ravel()])
    for point, expected in zip(chain.points, (t_2, t_3, t_4, t_full), strict=True):
        position, rotation = poses(chain, coordinates, point)
        np.testing.assert_allclose(position, expected[:3, 3], rtol=0, atol=1e-14)
        np.testing.assert_allclose(rotation, expected[:3, :3], rtol=0, atol=1e-14)


def test_jacobian_of_the_springs_agrees_with_pinocchio(kuka_extended):
    chain = extended_chain(kuka_extended)
    coordinates = np.random.default_rng(3).uniform(-0.3, 0.3, (5, 36))
    for point in chain.points:
        found = poses_and_jacobians(chain, coordinates, point)[2]
        model = PinocchioPoint(chain, point)
        for index, one in enumerate(coordinates):
            np.testing.assert_allclose(found[index], model.pose_and_jacobian(one)[2], rtol=0, atol=1e-13)


def test_extended_deflection_is_that_of_joints_and_beams_added_up(kuka_extended):
    loads = random_loads(kuka_extended, 1, 5, force=1.0)
    point = kuka_extended.chain.end_effector
    found = true_deflections(kuka_extended, loads, point, "end_effector")
    expected = true_deflections(replace(kuka_extended, links=()), loads, point, "end_effector")
    end = poses(kuka_extended.chain, loads.joint_angles, point)[0]
    for link in kuka_extended.links:
        position, rotation = poses(kuka_extended.chain, loads.joint_angles, replace(point, after=link.after))
        for index in np.ndindex(1, 5):
            axes, lever = np.kron(np.eye(2), rotation[index]), end[index] - position[index]
            force, moment = loads.wrench[index][:3], loads.wrench[index][3:]
            bend = integrated_beam(link.tube, link.vector_m)
            tip = axes @ bend @ axes.T @ np.concatenate([force, moment + np.cross(lever, force)])
            expected[index] += np.concatenate([tip[:3] + np.cross(tip[3:], lever), tip[3:]])
    # One newton keeps what is of second order below 1e-11 m; differences of poses round at 1e-15 m.
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-11)
    assert np.abs(expected).max() > 1e-7
