"""A robot: its angles as the controller reports them, and targets on all of its
points."""

from dataclasses import replace

import numpy as np
import pytest
from support import robot_of

from elastocal.io.documents import read_document
from elastocal.mechanics.robot import estimate_typical_compliance
from elastocal.mechanics.robot_file import parse_robot


def test_reported_angles_are_converted_both_ways():
    matrix = np.array([[1.0, 0.0], [1.0, -1.0]])
    offset = np.radians([90.0, -45.0])
    robot = replace(
        robot_of("Rz(q1) Tx(1) Ry(q2) [A]"),
        reported_matrix=matrix,
        reported_offset=offset,
    )
    reported = np.radians([[10.0, 20.0], [-30.0, 5.0], [0.0, 0.0]])
    angles = np.radians([[100.0, -55.0], [60.0, -80.0], [90.0, -45.0]])
    np.testing.assert_allclose(robot.model_angles(reported), angles, rtol=1e-12)
    np.testing.assert_allclose(robot.reported_angles(angles), reported, atol=1e-12)
    np.testing.assert_allclose(robot.model_angles(reported[0]), angles[0], rtol=1e-12)


@pytest.fixture
def following():
    """A robot whose second joint follows the first one."""
    return replace(
        robot_of("Rz(q1) Tx(1) Ry(q2) Tx(1) Rz(q3) [A]"),
        reported_matrix=np.array([[1.0, 0.0], [-0.5, 0.0], [0.0, 1.0]]),
        reported_offset=np.array([0.0, 0.2, 0.1]),
        joint_limits=np.array([[-2.0, 1.0], [-1.0, 1.0], [-3.0, 3.0]]),
    )


def test_joints_that_follow_have_no_command(following):
    assert (following.joints, following.commands) == (3, 2)
    np.testing.assert_array_equal(following.leading_joints, [0, 2])
    np.testing.assert_array_equal(following.is_coupled, [True, True, False])
    rail = robot_of("Rz(q1) Tx(1) Rz(q2) Tx(q3) [A]").chain
    assert replace(following, chain=rail).prismatic_commands == (False, True)
    reported = np.array([[0.4, -0.3], [1.0, 0.0]])
    angles = following.model_angles(reported)
    np.testing.assert_allclose(angles, [[0.4, 0.0, -0.2], [1.0, -0.3, 0.1]])
    np.testing.assert_allclose(following.reported_angles(angles), reported)


def test_angles_at_shares_of_the_limits_are_those_of_commands(following):
    shares = np.array([[0.0, 0.5], [1.0, 1.0]])
    angles = following.spread_angles(shares, following.joint_limits)
    np.testing.assert_allclose(angles[:, [0, 2]], [[-2.0, 0.0], [1.0, 3.0]])
    by_commands = following.model_angles(following.reported_angles(angles))
    np.testing.assert_allclose(angles, by_commands)


def test_restricted_jacobians_have_the_motions_of_commands(following):
    """A motion along the directions is one that a command brings about, and none is
    lost."""
    jacobian = np.random.default_rng(1).normal(size=(2, 6, 3))
    restricted = following.restrict_jacobians(jacobian)
    assert restricted.shape == (2, 6, 2)
    steps = np.array([[1.0, 2.0], [-0.5, 0.3]])
    angles = following.expand_steps(steps)
    np.testing.assert_allclose(
        restricted @ steps[..., None], jacobian @ angles[..., None]
    )
    np.testing.assert_allclose(angles[:, 1], -0.5 * angles[:, 0])
    np.testing.assert_allclose(
        np.linalg.norm(angles, axis=1), np.linalg.norm(steps, axis=1)
    )


@pytest.mark.parametrize("name", ["kuka", "fanuc", "fanuc_measured"])
def test_published_compliances_are_within_a_factor_of_five_of_typical_ones(
    name, config_folder
):
    robot = parse_robot(read_document(config_folder / "robots" / f"{name}.yaml"))
    ratio = robot.compliance / estimate_typical_compliance(
        robot.chain, robot.payload_kg
    )
    assert (np.maximum(ratio, 1 / ratio) < 5).all()
