"""Samples of MoveIt's hand-eye calibration give the poses of the board."""

import numpy as np
from made_boards import make_board_poses, stack_matrices
from support import refused

from elastocal.exchange.moveit_samples import is_moveit_samples, read_moveit_samples


def make_samples():
    _, rotation, position = make_board_poses(3)
    return [
        {
            "effector_wrt_world": np.eye(4).ravel().tolist(),
            "object_wrt_sensor": matrix.ravel().tolist(),
        }
        for matrix in stack_matrices(rotation, position)
    ]


def test_the_board_is_read_and_the_robots_own_pose_is_not():
    samples = make_samples()
    assert is_moveit_samples(samples)
    poses = read_moveit_samples(samples, "samples.yaml")
    _, rotation, position = make_board_poses(3)
    np.testing.assert_array_equal(poses.position, position)
    np.testing.assert_array_equal(poses.rotation, rotation)
    assert poses.angles is None


def test_a_sample_without_16_numbers_is_refused():
    samples = make_samples()
    samples[1]["object_wrt_sensor"] = [1, 2, 3]
    with refused("samples.yaml", "sample 2, object_wrt_sensor", "[1, 2, 3]", "16"):
        read_moveit_samples(samples, "samples.yaml")
    assert not is_moveit_samples({"samples": []})
