"""Corrected targets put back into the forward model, and what is said of those that cannot be corrected."""

import numpy as np
import pytest
from calibrated_robots import drawn_commands, made_calibrated

from elastocal.application.calibrated import coordinates_at_rest, end_effector, forward, nominal_forward
from elastocal.application.compensation import OK, OUTSIDE_LIMITS, SINGULAR, UNREACHABLE, corrected
from elastocal.mechanics.kinematics import jacobians
from elastocal.mechanics.pose_differences import pose_differences

EFFECTS = ("joint_offset", "link_geometry", "link_weight@2", "transmission_harmonic@1[orders 1-2")
# From the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


def settled(robot, commands):
    """As `forward`, with the loads found again until the arm has come to rest."""
    coordinates = coordinates_at_rest(robot, commands)
    for _ in range(5):
        coordinates = coordinates_at_rest(robot, commands, coordinates)
    return end_effector(robot, coordinates)


@pytest.mark.parametrize("name", ["gp180", "ur10", "fanuc_static", "iiwa14"])
def test_corrected_targets_bring_the_robot_to_the_wanted_poses(name):
    robot = made_calibrated(name, EFFECTS)
    commands = drawn_commands(robot, 150)
    position, rotation = nominal_forward(robot.robot, commands.joint_angles)
    found = corrected(robot, position, rotation, commands, commands.joint_angles)
    good = found.status == OK
    assert good.mean() > 0.9
    off = pose_differences(position, rotation, *settled(robot, commands.with_angles(found.joint_angles)))[good]
    assert np.abs(off).max() < 2e-9
    np.testing.assert_allclose(found.error_after[good], off, atol=2e-9)
    assert np.sqrt((found.error_before[good, :3] ** 2).sum(axis=1).mean()) > 1e-4


def test_the_error_before_is_that_of_the_rigid_robots_targets():
    robot = made_calibrated("gp180", EFFECTS)
    commands = drawn_commands(robot, 20)
    position, rotation = nominal_forward(robot.robot, commands.joint_angles)
    found = corrected(robot, position, rotation, commands, commands.joint_angles)
    np.testing.assert_allclose(nominal_forward(robot.robot, found.uncorrected)[0], position, atol=1e-7)
    missed = pose_differences(position, rotation, *forward(robot, commands.with_angles(found.uncorrected)))
    np.testing.assert_allclose(found.error_before, missed, atol=1e-12)


def test_repeatability_is_that_of_the_joints_seen_through_the_jacobian():
    robot = made_calibrated("gp180")
    commands = drawn_commands(robot, 4)
    pose = nominal_forward(robot.robot, commands.joint_angles)
    found = corrected(robot, *pose, commands, commands.joint_angles)
    draws = np.random.default_rng(1).standard_normal((20000, 6)) * robot.noise.joint_rad
    jacobian = jacobians(robot.robot.chain, robot.robot.model_angles(found.joint_angles), robot.robot.chain.end_effector)
    distances = np.linalg.norm(draws @ jacobian[:, :3].transpose(0, 2, 1), axis=2)
    np.testing.assert_allclose(found.repeatability_m, np.sqrt((distances**2).mean(axis=1)), rtol=0.03)


def test_what_cannot_be_corrected_is_named():
    robot = made_calibrated("gp180", EFFECTS)
    low, high = robot.robot.joint_limits.T
    angles = np.tile(0.5 * (low + high) + BENT, (4, 1))
    angles[1, 0] = high[0] + 0.2
    # The axes of joints 4 and 6 in one line.
    angles[2, 4] = 0.0
    commands = drawn_commands(robot, 4).with_angles(robot.robot.reported_angles(angles))
    position, rotation = nominal_forward(robot.robot, commands.joint_angles)
    position[3] *= 5.0
    found = corrected(robot, position, rotation, commands, commands.joint_angles)
    assert found.status.tolist() == [OK, OUTSIDE_LIMITS, SINGULAR, UNREACHABLE]
    assert np.isfinite(found.joint_angles).all()


def test_a_path_without_a_start_is_corrected_in_one_posture():
    robot = made_calibrated("gp180", EFFECTS)
    share = np.linspace(0.0, 1.0, 30)[:, None]
    angles = robot.robot.joint_limits.mean(axis=1) + BENT + 0.2 * share
    commands = drawn_commands(robot, 30).with_angles(robot.robot.reported_angles(angles))
    done = []
    found = corrected(robot, *nominal_forward(robot.robot, commands.joint_angles), commands, progress=done.append)
    assert (found.status == OK).all()
    assert np.abs(np.diff(found.joint_angles, axis=0)).max() < 0.05
    assert done == [30]
