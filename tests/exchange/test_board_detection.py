"""A board in rendered images is found where it was, within the stated standard errors."""

import csv

import numpy as np
import pytest
from made_images import CAMERA, make_views, render
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.exchange.board_detection import (
    COLUMNS,
    ImageCorners,
    detect_boards,
    estimate_pose,
    find_corners,
    find_images,
    summarize_detection,
    write_poses,
)
from elastocal.exchange.board_pattern import make_pattern

cv2 = pytest.importorskip("cv2")
CHARUCO = make_pattern("charuco", 6, 5, 0.03)
APRILTAGS = make_pattern("apriltag", 5, 4, 0.035)


def write_views(folder, pattern, count=6):
    """Write images of a board; return its rotation vectors and positions."""
    vectors, positions = make_views(pattern, count)
    for number in range(count):
        image = render(pattern, vectors[number], positions[number], seed=number)
        cv2.imwrite(str(folder / f"view_{number}.png"), image)
    return vectors, positions


@pytest.mark.parametrize("pattern", [CHARUCO, APRILTAGS], ids=["charuco", "apriltag"])
def test_poses_come_back_within_the_stated_standard_errors(pattern, tmp_path):
    vectors, positions = write_views(tmp_path, pattern)
    detection = detect_boards(find_images(tmp_path), pattern, CAMERA)
    assert [pose.image for pose in detection.poses] == [
        f"view_{number}.png" for number in range(6)
    ]
    assert detection.left_out == {}
    ratios = []
    for pose, vector, position in zip(detection.poses, vectors, positions, strict=True):
        difference = (
            Rotation.from_rotvec(pose.rotation) * Rotation.from_rotvec(vector).inv()
        )
        error = np.array([*(pose.position - position), *difference.as_rotvec()])
        ratios.append(error / pose.std)
        assert np.linalg.norm(error[:3]) < 1e-3
        assert pose.residual_px < 0.5
    # The noise of 36 numbers: their mean square is within a factor of two of what is
    # stated, of three with the systematic error of the rendering.
    assert 0.2 < np.mean(np.square(ratios)) < 4.0


def test_a_board_that_is_farther_away_is_less_certain():
    stds = []
    for distance in (0.4, 0.8):
        middle = np.array([*CHARUCO.size_m, 0.0]) / 2
        vector = np.array([0.5, 0.1, 0.0])
        position = [0, 0, distance] - Rotation.from_rotvec(vector).apply(middle)
        image = render(CHARUCO, vector, position)
        corners = find_corners(image, CHARUCO, CHARUCO.make_opencv_board())
        pose, _ = estimate_pose(ImageCorners("a.png", *corners), CAMERA)
        stds.append(pose.std)
    near, far = stds
    # Depth is the worst coordinate, and grows faster than the distance.
    assert near[2] > 2 * near[0]
    assert far[2] > 1.8 * near[2]


def test_the_camera_is_determined_from_the_same_images(tmp_path):
    write_views(tmp_path, CHARUCO, 12)
    detection = detect_boards(find_images(tmp_path), CHARUCO, None)
    np.testing.assert_allclose(detection.camera.matrix, CAMERA.matrix, atol=15)
    assert len(detection.poses) == 12
    assert summarize_detection(detection)["residual_px"] < 0.5


def test_too_few_images_do_not_determine_the_camera(tmp_path):
    write_views(tmp_path, CHARUCO, 3)
    with refused(tmp_path, "", "the board in 3 images", "at least 8", "--intrinsics"):
        detect_boards(find_images(tmp_path), CHARUCO, None)


def test_images_without_the_board_are_named_and_others_count(tmp_path):
    write_views(tmp_path, CHARUCO, 2)
    cv2.imwrite(str(tmp_path / "view_2.png"), np.full((480, 640), 120, np.uint8))
    detection = detect_boards(find_images(tmp_path), CHARUCO, CAMERA)
    assert detection.left_out == {"view_2.png": "0 corners"}
    assert len(detection.poses) == 2
    wrong = make_pattern("apriltag", 5, 4, 0.03)
    with refused(tmp_path, "", "markers of DICT_5X5_250", "board.yaml"):
        detect_boards(find_images(tmp_path), wrong, CAMERA)


def test_unreadable_and_unequal_images_are_refused(tmp_path):
    write_views(tmp_path, CHARUCO, 1)
    other = tmp_path / "view_9.png"
    cv2.imwrite(str(other), np.zeros((48, 64), np.uint8))
    with refused(other, "", "64 x 48 pixels", "640 x 480"):
        detect_boards(find_images(tmp_path), CHARUCO, CAMERA)
    other.write_text("no image")
    with refused(other, "", "no image that OpenCV reads", ".png"):
        detect_boards(find_images(tmp_path), CHARUCO, CAMERA)
    with refused(tmp_path / "none", "", "no image", ".png"):
        find_images(tmp_path / "none")


def test_images_are_sorted_by_their_numbers_and_written_one_a_row(tmp_path):
    for name in ("a10.png", "a9.png", "a1.png"):
        (tmp_path / name).touch()
    names = [path.name for path in find_images(tmp_path)]
    assert names == ["a1.png", "a9.png", "a10.png"]
    folder = tmp_path / "views"
    folder.mkdir()
    write_views(folder, CHARUCO, 2)
    detection = detect_boards(find_images(folder), CHARUCO, CAMERA)
    write_poses(tmp_path / "boards.csv", detection.poses)
    with open(tmp_path / "boards.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == COLUMNS
    assert float(rows[1]["x"]) == detection.poses[1].position[0]
