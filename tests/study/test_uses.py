"""Poses of ISO 9283 and a milling path: where they lie, and that the robot reaches them within its limits."""

import numpy as np
import pytest

from elastocal.application.inverse_kinematics import find_beyond_limits
from elastocal.mechanics.kinematics import poses
from elastocal.study.uses import iso_9283, milling_path

CENTRE = (1.6, 0.0, 1.0)


def find_positions(robot, use):
    position, rotation = poses(robot.chain, use.joint_angles[0], robot.chain.end_effector)
    assert not find_beyond_limits(robot, use.joint_angles[0]).any()
    # The spindle looks down.
    np.testing.assert_allclose(rotation[..., 0], np.tile([0, 0, -1.0], (len(position), 1)), atol=1e-6)
    return position


def test_five_poses_lie_on_the_diagonals_of_a_cube_a_tenth_from_their_ends(robot):
    use = iso_9283(robot, CENTRE, 1.0, 800.0)
    position = find_positions(robot, use) - CENTRE
    np.testing.assert_allclose(position[0], 0, atol=1e-6)
    # Space diagonals of the unit cube have length sqrt 3.
    np.testing.assert_allclose(np.linalg.norm(position[1:], axis=1), 0.4 * np.sqrt(3), atol=1e-6)
    np.testing.assert_allclose(position[1] + position[3], 0, atol=1e-6)
    # One plane through the centre, sloped by 45 degrees.
    np.testing.assert_allclose(position[:, 0], position[:, 2], atol=1e-6)
    np.testing.assert_array_equal(use.wrench[0], np.tile([0, 0, -800.0, 0, 0, 0], (5, 1)))


def test_a_milling_path_is_straight_and_level_with_a_force_against_its_feed(robot):
    use = milling_path(robot, CENTRE, 0.5, 500.0)
    position = find_positions(robot, use)
    steps = np.diff(position, axis=0)
    np.testing.assert_allclose(steps, np.tile(steps[0], (len(steps), 1)), atol=1e-6)
    assert np.linalg.norm(position[-1] - position[0]) == pytest.approx(0.5) and steps[0, 2] == pytest.approx(0, abs=1e-6)
    force = use.wrench[0, :, :3]
    assert np.linalg.norm(force, axis=1) == pytest.approx(500.0) and (force @ steps[0] < 0).all() and (force[:, 2] > 0).all()
    # No jump from one posture to another.
    assert np.abs(np.diff(use.joint_angles[0], axis=0)).max() < 0.05
