"""Intrinsic parameters are read from camera_info of ROS."""

import numpy as np
import pytest
import yaml
from made_images import CAMERA
from support import refused

from elastocal.exchange.camera_file import format_camera, read_camera


def test_a_camera_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "camera.yaml"
    path.write_text(format_camera(CAMERA))
    camera = read_camera(path)
    np.testing.assert_array_equal(camera.matrix, CAMERA.matrix)
    np.testing.assert_array_equal(camera.distortion, CAMERA.distortion)
    assert camera.size == CAMERA.size


@pytest.mark.parametrize(
    ("changes", "key", "phrases"),
    [
        ({"camera_matrix": None}, "camera_matrix", ["no numbers", "ROS"]),
        ({"camera_matrix": {"data": [1, 2]}}, "camera_matrix", ["2 numbers", "9"]),
        (
            {"camera_matrix": {"data": [0, 0, 0, 0, 900, 0, 0, 0, 1]}},
            "camera_matrix",
            ["fx 0", "positive"],
        ),
        (
            {"distortion_coefficients": {"data": [float("nan")]}},
            "distortion_coefficients",
            ["not finite"],
        ),
    ],
)
def test_other_contents_are_refused(changes, key, phrases, tmp_path):
    path = tmp_path / "camera.yaml"
    document = yaml.safe_load(format_camera(CAMERA)) | changes
    path.write_text(yaml.safe_dump(document))
    with refused(path, key, *phrases):
        read_camera(path)
