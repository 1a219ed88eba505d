"""All eight postures of an arm with a spherical wrist, in closed form."""

import numpy as np
import pytest
from analysed_robots import analysed

from elastocal.application.spherical_wrist import (
    find_spherical_wrist,
    solve_all_postures,
)
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.kinematics import compute_pose_differences, compute_poses

# Their axes turn both ways, and their chains put constants and offsets elsewhere.
SPHERICAL = ("kuka", "fanuc", "abb", "gp180", "irb7600", "m900ib700")
COUNT = 500


def draw_angles(seed=1):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (COUNT, 6))


def solve(chain, position, rotation):
    return solve_all_postures(find_spherical_wrist(chain), position, rotation)


def compute_errors(chain, angles, position, rotation):
    """Largest component of the pose errors, m and rad, (8, N)."""
    reached_position, reached_rotation = compute_poses(
        chain, angles, chain.end_effector
    )
    errors = compute_pose_differences(
        np.broadcast_to(position, reached_position.shape),
        np.broadcast_to(rotation, reached_rotation.shape),
        reached_position,
        reached_rotation,
    )
    return np.abs(errors).max(axis=-1)


def measure_distances(angles, others):
    """Largest difference of joint angles modulo whole turns."""
    return np.abs((angles - others + np.pi) % (2 * np.pi) - np.pi).max(axis=-1)


@pytest.mark.parametrize("name", SPHERICAL)
def test_every_posture_reaches_the_pose_and_one_is_that_of_the_pose(name):
    chain = analysed(name).chain
    drawn = draw_angles()
    pose = compute_poses(chain, drawn, chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    assert compute_errors(chain, angles, *pose)[is_reached].max() < 1e-9
    assert measure_distances(angles, drawn).min(axis=0).max() < 1e-6


@pytest.mark.parametrize("name", SPHERICAL)
def test_eight_postures_differ_or_the_arm_does_not_reach_backwards(name):
    """The elbow and the wrist always have two sides. The arm that faces away from the
    pose need not reach it."""
    chain = analysed(name).chain
    pose = compute_poses(chain, draw_angles(), chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    counts = is_reached.sum(axis=0)
    assert set(counts) == {4, 8} and (counts == 8).mean() > 0.5
    for first in range(8):
        for second in range(first):
            both = is_reached[first] & is_reached[second]
            distances = measure_distances(angles[first], angles[second])
            assert distances[both].min() > 1e-3


def test_a_pose_beyond_the_reach_has_no_posture():
    chain = analysed("kuka").chain
    position, rotation = compute_poses(chain, draw_angles(), chain.end_effector)
    _, is_reached = solve(chain, position + 10.0, rotation)
    assert not is_reached.any()


@pytest.mark.parametrize("angle_5", [0.0, 1e-12, np.pi])
def test_an_aligned_wrist_has_a_posture_that_reaches_the_pose(angle_5):
    chain = analysed("kuka").chain
    drawn = draw_angles()
    drawn[:, 4] = angle_5
    pose = compute_poses(chain, drawn, chain.end_effector)
    angles, is_reached = solve(chain, *pose)
    assert (is_reached.sum(axis=0) >= 4).all()
    assert compute_errors(chain, angles, *pose)[is_reached].max() < 1e-7


@pytest.mark.parametrize(
    "text",
    [
        "Rz(q1) Ry(q2) Tz(a) Ry(q3) Tx(a) Rx(q4) Ry(q5) Tz(d) Rx(q6) [6DoF]",
        "Rz(q1) Rx(q2) Tz(a) Ry(q3) Tx(a) Rx(q4) Ry(q5) Tx(d) Rx(q6) [6DoF]",
        "Rz(q1) Ry(q2) Tz(a) Ry(q3) Tx(a) Tx(q4) Ry(q5) Tx(d) Rx(q6) [6DoF]",
    ],
    ids=["offset wrist", "crossed shoulder", "prismatic"],
)
def test_other_arms_have_no_closed_form(text):
    assert find_spherical_wrist(parse_chain(text, {"a": 1.0, "d": 0.1}, "")) is None


@pytest.mark.parametrize("name", ["ur5", "ur10", "iiwa14", "panda"])
def test_robots_without_a_spherical_wrist_are_noticed(name):
    assert find_spherical_wrist(analysed(name).chain) is None
