"""The kind `board`: where the camera is decides whose pose a row states."""

import numpy as np
import pytest
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


@pytest.fixture
def views():
    """Poses of a board in a camera that is turned to its middle, and the middle."""
    draws = np.random.default_rng(3)
    middle = np.array([-0.2, 0.15, 0.0])
    turned = Rotation.from_rotvec(0.4 * draws.standard_normal((40, 3))).as_matrix()
    sight = np.column_stack([0.02 * draws.standard_normal((40, 2)), np.full(40, 0.5)])
    return sight - turned @ middle, turned, middle


@pytest.mark.parametrize("camera", [ON_ROBOT, BESIDE_ROBOT])
def test_the_middle_of_the_board_is_where_cameras_look(views, camera):
    position, turned, middle = views
    poses = BOARD.convert(position, turned, {"camera": camera})
    options = BOARD.refer_noise(*poses, {"camera": camera})
    np.testing.assert_allclose(options["middle_m"], middle, atol=0.02)
    assert options["range_m"] == pytest.approx(0.5, rel=0.05)
    # The range is that of the campaign also for a single one of its images.
    single = BOARD.shape_noise(poses[0][:1], poses[1][:1], options)
    whole = BOARD.shape_noise(*poses, options)
    np.testing.assert_allclose(single.sizes[0], whole.sizes[0])


@pytest.mark.parametrize("camera", [ON_ROBOT, BESIDE_ROBOT])
def test_errors_are_those_of_the_middle_wherever_the_origin_is(views, camera):
    position, turned, middle = views
    poses = BOARD.convert(position, turned, {"camera": camera})
    options = {"camera": camera, "middle_m": middle, "range_m": 0.5}
    shape = BOARD.shape_noise(*poses, options)
    step = 1e-7
    for column in range(6):
        error = step * shape.axes[:, :, column]
        rotated = Rotation.from_rotvec(error[:, 3:]).as_matrix() @ poses[1]
        moved = BOARD.convert(poses[0] + error[:, :3], rotated, {"camera": camera})
        seen = moved[0] + moved[1] @ middle
        shift = (seen - position - turned @ middle) / step
        # An error of rotation leaves the middle where it is.
        expected = np.eye(6)[column, :3] * (column < 3)
        np.testing.assert_allclose(shift, np.tile(expected, (40, 1)), atol=1e-5)
