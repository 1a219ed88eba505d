"""Data sets as the paper makes them: random loads with the right distribution, exact deflections, noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import kstest

from elastocal.mechanics.kinematics import poses
from elastocal.study.simulation import Loading, measurement_noise, random_experiments

PAPER = Loading(1000.0, (0.0, 0.5, 0.0), "base", "full_turn")


def draw(robot, loading=PAPER, seed=1, key="kuka", purpose="identification", data_sets=range(4), configurations=5):
    return random_experiments(robot.chain, robot.joint_limits, seed, key, loading, purpose, data_sets, configurations)


@pytest.mark.parametrize("change", [{"seed": 2}, {"key": "fanuc"}, {"purpose": "test"}, {"data_sets": range(4, 8)}])
def test_another_seed_robot_purpose_or_set_gives_other_experiments(kuka, change):
    loads, others = draw(kuka), draw(kuka, **change)
    assert not np.isin(loads.joint_angles, others.joint_angles).any()
    assert not np.isin(loads.wrench[..., :3], others.wrench[..., :3]).any()


def test_forces_are_uniform_on_the_sphere(kuka):
    direction = draw(kuka, data_sets=range(20), configurations=1000).wrench[..., :3].reshape(-1, 3) / 1000
    five_sigma = 5 / np.sqrt(len(direction))
    # Kolmogorov-Smirnov at 1e-4: of 20,000 it sees a distribution that is off by 0.025 anywhere with a power of 0.99.
    # Each component of a direction uniform on the sphere is uniform in [-1, 1] (Archimedes).
    for component in direction.T:
        assert kstest(component, "uniform", (-1, 2)).pvalue > 1e-4
    np.testing.assert_allclose(direction.mean(axis=0), 0, atol=five_sigma * np.sqrt(1 / 3))
    np.testing.assert_allclose(direction.T @ direction / len(direction), np.eye(3) / 3, atol=five_sigma * 0.3)
    np.testing.assert_allclose((direction**4).mean(axis=0), 1 / 5, atol=five_sigma * np.sqrt(1 / 9 - 1 / 25))


def test_joint_angles_are_uniform_over_the_full_turn(kuka):
    angles = draw(kuka, data_sets=range(10), configurations=500).joint_angles.reshape(-1, 6)
    # Of 5,000 it sees 0.05 anywhere with a power of 0.99.
    for joint in angles.T:
        assert kstest(joint, "uniform", (-np.pi, 2 * np.pi)).pvalue > 1e-4


def test_joint_angles_are_uniform_within_the_limits(fanuc):
    loading = replace(PAPER, joint_range="limits")
    angles = draw(fanuc, loading, data_sets=range(10), configurations=500).joint_angles.reshape(-1, 6)
    for joint, (low, high) in zip(angles.T, fanuc.joint_limits, strict=True):
        assert kstest(joint, "uniform", (low, high - low)).pvalue > 1e-4
        assert low <= joint.min() and joint.max() <= high


def test_offset_in_the_tool_frame_turns_with_the_tool(kuka):
    base, tool = draw(kuka), draw(kuka, replace(PAPER, offset_frame="tool"))
    np.testing.assert_array_equal(tool.joint_angles, base.joint_angles)
    np.testing.assert_array_equal(tool.wrench[..., :3], base.wrench[..., :3])
    rotation = poses(kuka.chain, tool.joint_angles, kuka.chain.end_effector)[1]
    lever = rotation[..., 1] * 0.5
    np.testing.assert_allclose(tool.wrench[..., 3:], np.cross(lever, tool.wrench[..., :3]), rtol=0, atol=1e-10)


def test_noise_is_standard_normal_and_independent_between_components():
    noise = measurement_noise(1, "kuka", "6DoF", range(20), 500).reshape(-1, 6)
    # Of 10,000 it sees 0.035 anywhere with a power of 0.99: a standard deviation off by 16 %.
    for component in noise.T:
        assert kstest(component, "norm").pvalue > 1e-4
    np.testing.assert_allclose(np.corrcoef(noise.T), np.eye(6), atol=5 / np.sqrt(len(noise)))
