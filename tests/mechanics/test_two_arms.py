"""Two arms on one base become one chain between their flanges."""

from dataclasses import replace

import numpy as np
import pytest
from support import THREE_JOINTS, TRACK, UR10, refused, robot_of

from elastocal.effects.catalogue import candidates_on
from elastocal.mechanics.kinematics import compute_poses
from elastocal.mechanics.robot_file import describe_robot, parse_robot
from elastocal.mechanics.sites import build_sites
from elastocal.mechanics.two_arms import join_arms


@pytest.fixture
def carrier():
    """An arm whose controller counts its joints otherwise than the chain."""
    return replace(
        robot_of(f"Tx(0.3) Rz(30deg) {THREE_JOINTS}"),
        reported_matrix=np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 1.0]]),
        reported_offset=np.array([0.1, -0.2, 0.3]),
    )


@pytest.fixture
def arm():
    """The other arm."""
    return robot_of(f"Tx(-0.3) {UR10}")


def place_flange(robot, reported):
    """Poses of the end-effector in the base, at reported angles."""
    chain = robot.chain
    return compute_poses(chain, robot.model_angles(reported), chain.end_effector)


def test_the_chain_is_the_pose_of_one_flange_in_the_other(carrier, arm):
    reported = np.random.default_rng(0).uniform(-3.0, 3.0, (20, 9))
    position, rotation = place_flange(join_arms(carrier, arm), reported)
    base, base_rotation = place_flange(carrier, reported[:, :3])
    tip, tip_rotation = place_flange(arm, reported[:, 3:])
    expected = np.einsum("mji,mj->mi", base_rotation, tip - base)
    np.testing.assert_allclose(position, expected, atol=1e-12)
    expected_rotation = base_rotation.transpose(0, 2, 1) @ tip_rotation
    np.testing.assert_allclose(rotation, expected_rotation, atol=1e-12)


def test_limits_and_compliances_follow_their_joints(carrier, arm):
    carrier = replace(carrier, joint_limits=np.array([[-1, 1], [-2, 2], [-3, 3]]))
    joined = join_arms(carrier, arm)
    np.testing.assert_array_equal(joined.joint_limits[:3, 1], [3, 2, 1])
    np.testing.assert_array_equal(joined.compliance[:4], [3e-6, 2e-6, 1e-6, 1e-6])


def test_its_file_describes_the_same_robot(carrier, arm):
    joined = join_arms(carrier, arm)
    read = parse_robot(describe_robot(joined))
    reported = np.random.default_rng(0).uniform(-3.0, 3.0, (5, 9))
    for array, expected in zip(
        place_flange(read, reported), place_flange(joined, reported), strict=True
    ):
        np.testing.assert_allclose(array, expected, atol=1e-12)
    assert read.base_moves


def test_no_weight_is_a_cause_of_errors_on_a_base_that_moves(carrier, arm):
    alone = candidates_on(build_sites(arm)).values()
    joined = candidates_on(build_sites(join_arms(carrier, arm))).values()
    assert "gravity" in {candidate.family for candidate in alone}
    assert "gravity" not in {candidate.family for candidate in joined}


def test_weights_on_a_base_that_moves_are_refused(carrier, arm):
    document = describe_robot(join_arms(carrier, arm))
    document["gravity_m_s2"] = [0.0, 0.0, -9.8]
    with refused("robot", "gravity_m_s2", "base_moves"):
        parse_robot(document)


def test_a_carrier_that_slides_is_refused(arm):
    with refused("test", "chain", "slides", "second"):
        join_arms(robot_of(TRACK), arm)
