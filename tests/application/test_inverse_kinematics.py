"""Joint angles for wanted poses: within limits, without large steps, with the least
motion."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_chains import perturb_axes
from made_urdf import write_linkage
from scipy.interpolate import PchipInterpolator

from elastocal.application import inverse_kinematics
from elastocal.application.inverse_kinematics import (
    SOLVED_M,
    compute_allowed_steps,
    find_beyond_limits,
    solve_path,
)
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.mechanics.kinematics import compute_poses

# Angles from the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])
EXCESS_WEIGHT = 1e4


@pytest.mark.parametrize("name", ["kuka", "gp180", "abb"])
def test_a_path_about_the_base_has_no_large_step_if_a_turn_is_within_the_limits(name):
    """Seven targets 2 degrees apart about the base's vertical, the first axis limited
    to 185 degrees either way."""
    robot = analysed(name)
    limits = robot.joint_limits.copy()
    limits[0] = np.radians([-185.0, 185.0])
    robot = replace(robot, joint_limits=limits)
    angles = np.tile(limits.mean(axis=1) + BENT, (7, 1))
    angles[:, 0] = np.radians(np.linspace(-180.6, -168.6, 7))
    wanted = compute_poses(robot.chain, angles, robot.chain.end_effector)
    path, error_m = solve_path(robot, *wanted)
    assert error_m.max() < SOLVED_M and not find_beyond_limits(robot, path).any()
    np.testing.assert_allclose(
        np.degrees(path[:, 0]), np.degrees(angles[:, 0]), atol=1e-4
    )
    motion = np.degrees(np.abs(np.diff(path, axis=0)).sum())
    assert motion == pytest.approx(12.0, abs=1e-3)


def test_a_path_of_a_robot_with_a_joint_that_follows_needs_only_commands(tmp_path):
    """Joint angles of the path are those of commands, and the path is as smooth as the
    one from which its poses are."""
    robot = robot_from_urdf(write_linkage(tmp_path), "base", "tool").robot
    share = np.linspace(0.0, 1.0, 30)[:, None]
    commands = 0.3 + share * np.array([0.3, 0.4, -0.5, 0.3, 0.2, 0.6])
    angles = robot.model_angles(commands)
    wanted = compute_poses(robot.chain, angles, robot.chain.end_effector)
    path, error_m = solve_path(robot, *wanted)
    assert error_m.max() < SOLVED_M and not find_beyond_limits(robot, path).any()
    by_commands = robot.model_angles(robot.reported_angles(path))
    np.testing.assert_allclose(path, by_commands, atol=1e-12)
    assert np.abs(np.diff(path, axis=0)).max() < 0.05


def compute_motion_cost(step, allowed):
    """Length of steps (..., n) with the weighted excess above the allowed ones."""
    excess = np.maximum(step - allowed, 0.0)
    return (step + EXCESS_WEIGHT * excess).sum(axis=-1)


def test_a_step_may_be_five_times_the_rotation_of_the_path_and_ten_degrees():
    robot = analysed("gp180")
    angles = np.tile(robot.joint_limits.mean(axis=1) + BENT, (2, 1))
    angles[1, 0] += np.radians(3.0)
    wanted = compute_poses(robot.chain, angles, robot.chain.end_effector)
    allowed = compute_allowed_steps(robot, *wanted)
    np.testing.assert_allclose(np.degrees(allowed), 25.0)


def assert_solved_in_allowed_steps(robot, wanted):
    """Solve a path; return its joint angles."""
    path, error_m = solve_path(robot, *wanted)
    assert error_m.max() < SOLVED_M
    steps = np.abs(np.diff(path, axis=0))
    assert (steps <= compute_allowed_steps(robot, *wanted)).all()
    return path


def interpolate_path(robot, count):
    """Poses of a smooth path of the joints through six random postures."""
    low, high = robot.joint_limits.T
    shares = np.random.default_rng(3).uniform(0.2, 0.8, (6, robot.joints))
    knots = PchipInterpolator(np.arange(6), low + (high - low) * shares)
    angles = knots(np.linspace(0, 5, count))
    return compute_poses(robot.chain, angles, robot.chain.end_effector)


@pytest.mark.parametrize("name", ["kuka", "gp180", "ur10"])
def test_a_path_in_closed_form_is_no_longer_than_one_from_random_starts(
    name, monkeypatch
):
    robot = analysed(name)
    wanted = interpolate_path(robot, 60)
    path, error_m = solve_path(robot, *wanted)
    monkeypatch.setattr(inverse_kinematics, "find_closed_form", lambda chain: None)
    from_random_starts, _ = solve_path(robot, *wanted)
    assert error_m.max() < SOLVED_M and not find_beyond_limits(robot, path).any()
    allowed = compute_allowed_steps(robot, *wanted)
    costs = [
        compute_motion_cost(np.abs(np.diff(angles, axis=0)), allowed).sum()
        for angles in (path, from_random_starts)
    ]
    assert costs[0] <= costs[1] + 1e-3


def test_a_path_through_aligned_wrists_keeps_the_angles_of_its_neighbours():
    """Joints 4 and 6 are on one line in the middle of the path, where infinitely many
    angles reach the pose."""
    robot = analysed("kuka")
    angles = np.tile(robot.joint_limits.mean(axis=1) + BENT, (21, 1))
    # The other side of the elbow, which is not aligned, is beyond the limits.
    limits = robot.joint_limits.copy()
    limits[2, 0] = 0.0
    robot = replace(robot, joint_limits=limits)
    angles[:, 3] = np.radians(50.0)
    angles[:, 4] = np.radians(np.abs(np.linspace(-20.0, 20.0, 21)))
    angles[8:13, 4] = 0.0
    angles[8:13, 0] += np.radians([0.0, 0.5, 1.0, 0.5, 0.0])
    wanted = compute_poses(robot.chain, angles, robot.chain.end_effector)
    assert_solved_in_allowed_steps(robot, wanted)


@pytest.mark.parametrize("name", ["kuka", "ur10"])
def test_a_robot_with_calibrated_axes_starts_from_the_closed_form(name, monkeypatch):
    robot = analysed(name)
    robot = replace(robot, chain=perturb_axes(robot.chain, 5e-4))
    wanted = interpolate_path(robot, 60)
    monkeypatch.setattr(inverse_kinematics, "_solve_from_anchors", None)
    path = assert_solved_in_allowed_steps(robot, wanted)
    assert not find_beyond_limits(robot, path).any()


def test_a_target_that_the_nearest_arm_does_not_reach_is_solved_from_its_neighbours(
    monkeypatch,
):
    """The postures of an arm with calibrated axes come from the nearest arm that has a
    closed form, which may miss some or all of them."""
    robot = analysed("kuka")
    robot = replace(robot, chain=perturb_axes(robot.chain, 5e-4))
    wanted = interpolate_path(robot, 60)
    solve = inverse_kinematics._solve_in_closed_form

    def miss_a_target(*arguments):
        solutions = solve(*arguments)
        solutions.error_m[:, 30] = np.inf
        return solutions

    monkeypatch.setattr(inverse_kinematics, "_solve_in_closed_form", miss_a_target)
    assert_solved_in_allowed_steps(robot, wanted)


def test_a_path_through_an_aligned_wrist_of_parallel_axes_is_continued():
    """With joint 5 at zero axis 6 is parallel to axes 2 to 4: any angle of joint 6 has
    the orientation, but few of them the position."""
    robot = analysed("ur10")
    angles = np.tile([0.3, -1.2, 1.5, -0.8, 0.0, 0.4], (21, 1))
    angles[:, 4] = np.abs(np.linspace(-0.3, 0.3, 21))
    angles[8:13, 4] = 0.0
    angles[8:13, 0] += np.radians([0.0, 0.5, 1.0, 0.5, 0.0])
    wanted = compute_poses(robot.chain, angles, robot.chain.end_effector)
    assert_solved_in_allowed_steps(robot, wanted)
