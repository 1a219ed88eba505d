"""Joint angles for wanted poses: found again, within limits, without jumps, or known to
be out of reach."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.application.inverse_kinematics import (
    SOLVED_M,
    _find_least_motion,
    _PathCandidates,
    compute_allowed_steps,
    find_beyond_limits,
    solve_path,
)
from elastocal.mechanics.kinematics import poses

# From the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


@pytest.mark.parametrize("name", ["kuka", "gp180", "abb"])
def test_a_path_about_the_base_does_not_swing_where_a_turn_lies_within_the_limits(name):
    """Seven targets 2 degrees apart about the base's vertical, the first axis limited
    to 185 degrees either way."""
    robot = analysed(name)
    limits = robot.joint_limits.copy()
    limits[0] = np.radians([-185.0, 185.0])
    robot = replace(robot, joint_limits=limits)
    angles = np.tile(limits.mean(axis=1) + BENT, (7, 1))
    angles[:, 0] = np.radians(np.linspace(-180.6, -168.6, 7))
    found, left = solve_path(
        robot, *poses(robot.chain, angles, robot.chain.end_effector)
    )
    assert left.max() < SOLVED_M and not find_beyond_limits(robot, found).any()
    np.testing.assert_allclose(
        np.degrees(found[:, 0]), np.degrees(angles[:, 0]), atol=1e-4
    )
    assert np.degrees(np.abs(np.diff(found, axis=0)).sum()) == pytest.approx(
        12.0, abs=1e-3
    )


def test_the_least_motion_is_the_best_of_all_ways_through_all_postures_and_turns():
    draws = np.random.default_rng(2)
    counts = (1, 2, 3)
    limits = np.array([[-4.0, 4.0], [-4.0, 7.0], [-4.0, 14.0]])
    weight = 1e4
    for _ in range(10):
        lowest = draws.uniform(-3, 3, (2, 4, 3))
        allowed = draws.uniform(0.5, 3, (3, 3))
        copies = [
            lowest[..., j, None] + 2 * np.pi * np.arange(count)
            for j, count in enumerate(counts)
        ]
        turns = 2 * np.pi * np.array(list(itertools.product(*map(range, counts))))
        ways = np.stack(
            [(lowest[:, row, None] + turns).reshape(-1, 3) for row in range(4)], axis=1
        )
        shortest = np.where((ways[:, 0] > limits[:, 1]).any(axis=1), np.inf, 0.0)
        for row in range(1, 4):
            step = np.abs(ways[:, None, row] - ways[None, :, row - 1])
            cost = (step + weight * np.maximum(step - allowed[row - 1], 0.0)).sum(
                axis=2
            )
            shortest = (cost + shortest).min(axis=1) + np.where(
                (ways[:, row] > limits[:, 1]).any(axis=1), np.inf, 0.0
            )
        step = np.abs(
            np.diff(
                _find_least_motion(
                    _PathCandidates(copies, limits, np.zeros((2, 4)), allowed)
                ),
                axis=0,
            )
        )
        assert (step + weight * np.maximum(step - allowed, 0.0)).sum() == pytest.approx(
            shortest.min(), abs=1e-2
        )


def test_a_step_may_be_five_times_what_the_path_turns_and_ten_degrees():
    robot = analysed("gp180")
    angles = np.tile(robot.joint_limits.mean(axis=1) + BENT, (2, 1))
    angles[1, 0] += np.radians(3.0)
    found = compute_allowed_steps(
        robot, *poses(robot.chain, angles, robot.chain.end_effector)
    )
    np.testing.assert_allclose(np.degrees(found), 25.0)
