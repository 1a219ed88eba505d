"""The kind `board`: where the camera is decides whose pose a row states."""

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.measuring.board import BESIDE_ROBOT, BOARD, ON_ROBOT


def test_a_camera_on_the_robot_is_the_target_and_its_board_the_frame():
    rotation = Rotation.random(5, random_state=1).as_matrix()
    position = np.random.default_rng(1).standard_normal((5, 3))
    placed, turned = BOARD.convert(position, rotation, {"camera": ON_ROBOT})
    # The board is at the origin of the frame: seen from the camera it is where it was.
    np.testing.assert_allclose(
        (turned.transpose(0, 2, 1) @ -placed[..., None])[..., 0], position, atol=1e-14
    )
    np.testing.assert_allclose(
        turned @ rotation, np.tile(np.eye(3), (5, 1, 1)), atol=1e-14
    )


def test_a_camera_beside_the_robot_is_the_frame():
    rotation = Rotation.random(5, random_state=1).as_matrix()
    position = np.ones((5, 3))
    placed, turned = BOARD.convert(position, rotation, {"camera": BESIDE_ROBOT})
    assert placed is position
    assert turned is rotation
