"""Samples of easy_handeye, of ROS 1 and ROS 2, give the poses of the board."""

import numpy as np
import pytest
from made_boards import make_board_poses
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.exchange.easy_handeye_samples import (
    is_easy_handeye_samples,
    read_easy_handeye_samples,
)


def make_transforms():
    _, rotation, position = make_board_poses(3)
    transforms = []
    for vector, quaternion in zip(
        position, Rotation.from_matrix(rotation).as_quat(), strict=True
    ):
        transforms.append(
            {
                "translation": dict(zip("xyz", vector.tolist(), strict=True)),
                "rotation": dict(zip("xyzw", quaternion.tolist(), strict=True)),
            }
        )
    return transforms


def make_document(ros):
    transforms = make_transforms()
    if ros == 1:
        return {"camera_marker_samples": {"transforms": transforms}}
    return {"parameters": {}, "samples": [{"tracking": board} for board in transforms]}


@pytest.mark.parametrize("ros", [1, 2])
def test_the_board_is_read(ros):
    document = make_document(ros)
    assert is_easy_handeye_samples(document)
    poses = read_easy_handeye_samples(document, "mine.samples")
    _, rotation, position = make_board_poses(3)
    np.testing.assert_allclose(poses.position, position)
    np.testing.assert_allclose(poses.rotation, rotation, atol=1e-12)


def test_a_sample_without_a_transform_is_refused():
    document = make_document(2)
    del document["samples"][2]["tracking"]["rotation"]["w"]
    with refused("mine.samples", "sample 3, tracking", "no rotation", "{x, y, z, w}"):
        read_easy_handeye_samples(document, "mine.samples")
    with refused("mine.samples", "", "no sample"):
        read_easy_handeye_samples({"samples": []}, "mine.samples")
    zero = {"samples": [{"tracking": make_transforms()[0]}]}
    zero["samples"][0]["tracking"]["rotation"] = dict.fromkeys("xyzw", 0.0)
    with refused("mine.samples", "sample 1", "a quaternion of length 0"):
        read_easy_handeye_samples(zero, "mine.samples")
    assert not is_easy_handeye_samples([1])
