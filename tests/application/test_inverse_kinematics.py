"""Joint angles for wanted poses: found again, within limits, without jumps, or known to be out of reach."""

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.application.inverse_kinematics import SOLVED_M, along_path, find_beyond_limits, reach_m, refine
from elastocal.mechanics.kinematics import poses


def find_poses(robot, angles):
    return poses(robot.chain, angles, robot.chain.end_effector)


def draw_angles(robot, count, seed=1, share=0.8):
    low, high = robot.joint_limits.T
    return low + (high - low) * (0.5 + share * (np.random.default_rng(seed).random((count, robot.joints)) - 0.5))


@pytest.mark.parametrize("name", ["gp180", "ur10", "fanuc_cpa", "iiwa14"])
def test_refined_angles_reach_the_poses_from_nearby(name):
    robot = analysed(name)
    angles = draw_angles(robot, 200)
    found, left = refine(robot, *find_poses(robot, angles), angles + 0.05)
    assert (left < SOLVED_M).mean() > 0.98
    good = left < SOLVED_M
    np.testing.assert_allclose(find_poses(robot, found)[0][good], find_poses(robot, angles)[0][good], atol=1e-7)
    np.testing.assert_allclose(find_poses(robot, found)[1][good], find_poses(robot, angles)[1][good], atol=1e-7)


def test_what_is_out_of_reach_stays_unsolved():
    robot = analysed("gp180")
    position, rotation = find_poses(robot, draw_angles(robot, 3))
    found, left = refine(robot, position * 5.0, rotation, draw_angles(robot, 3))
    assert (left > 0.1).all()
    assert np.isfinite(found).all()


def test_a_smooth_path_stays_smooth_and_within_limits():
    robot = analysed("gp180")
    share = np.linspace(0.0, 1.0, 80)[:, None]
    bent = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])
    angles = robot.joint_limits.mean(axis=1) + bent + 0.3 * np.sin(3.0 * share * np.arange(1, 7))
    found, left = along_path(robot, *find_poses(robot, angles))
    assert left.max() < SOLVED_M
    assert not find_beyond_limits(robot, found).any()
    assert np.abs(np.diff(found, axis=0)).max() < 3.0 * np.abs(np.diff(angles, axis=0)).max()


def test_single_poses_are_found_without_a_start():
    robot = analysed("ur10")
    angles = draw_angles(robot, 60, 3)
    _, left = along_path(robot, *find_poses(robot, angles))
    assert (left < SOLVED_M).mean() > 0.95


def test_limits_count_beyond_rounding_alone():
    robot = analysed("gp180")
    high = robot.joint_limits[:, 1]
    assert not find_beyond_limits(robot, high + 1e-12).any()
    assert find_beyond_limits(robot, high + 1e-6).all()


def test_the_reach_is_that_of_the_chain_stretched_out():
    robot = analysed("ur10")
    assert reach_m(robot) == pytest.approx(sum(abs(t.constant) for t in robot.chain.transforms if t.kind == "T"))
