"""The table of `elastocal detect` is read with its noise and its images."""

import numpy as np
import pytest
from made_boards import PANDA, make_board_poses
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.campaigns.reading import read_robot
from elastocal.exchange.board_detection import DetectedPose, write_poses
from elastocal.exchange.board_programs import BoardOptions, read_board_poses
from elastocal.exchange.detected_poses import is_detected_poses, read_detected_poses

ANGLES, ROTATION, POSITION = make_board_poses(5)
STD = np.array([1e-4, 1e-4, 4e-4, 2e-3, 2e-3, 1e-3])


@pytest.fixture
def table(tmp_path):
    vectors = Rotation.from_matrix(ROTATION).as_rotvec()
    poses = []
    for number in range(5):
        pose = DetectedPose(
            f"{number}.png", POSITION[number], vectors[number], 30, 0.1, STD
        )
        poses.append(pose)
    write_poses(tmp_path / "boards.csv", poses)
    return tmp_path / "boards.csv"


def test_poses_are_read_as_they_were_written(table):
    assert is_detected_poses(table.read_text().split("\n")[0])
    poses = read_detected_poses(table)
    np.testing.assert_array_equal(poses.position, POSITION)
    np.testing.assert_allclose(poses.rotation, ROTATION, atol=1e-12)
    assert poses.images[4] == "4.png"
    # Root mean squares over the axes.
    assert poses.noise["position_m"] == pytest.approx(np.sqrt(6e-8))
    assert poses.noise["orientation_rad"] == pytest.approx(np.sqrt(3e-6))


def test_joint_angles_are_joined_by_the_image(table, tmp_path):
    joints = tmp_path / "joints.csv"
    header = "image," + ",".join(f"q{joint}" for joint in range(1, 8))
    lines = [header]
    for number in (9, 4, 3, 2, 1, 0):
        angles = ANGLES[number] if number < 5 else np.zeros(7)
        lines.append(f"{number}.png," + ",".join(map(str, angles)))
    joints.write_text("\n".join(lines) + "\n")
    options = BoardOptions(joints=joints, angles="rad")
    poses = read_board_poses(table, read_robot(PANDA), options)
    np.testing.assert_array_equal(poses.angles, ANGLES)
    joints.write_text("\n".join(lines[:-1]) + "\n")
    with refused(joints, "image", "no row of 0.png"):
        read_board_poses(table, read_robot(PANDA), options)


def test_a_cell_that_is_no_number_is_refused(table):
    table.write_text(table.read_text().replace("0.0001", "wide", 1))
    with refused(table, "line 2", "'wide'", "std_x_m"):
        read_detected_poses(table)
    table.write_text(table.read_text().split("\n")[0] + "\n")
    with refused(table, "", "no row", "elastocal detect"):
        read_detected_poses(table)
