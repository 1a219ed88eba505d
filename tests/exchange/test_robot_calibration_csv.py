"""Messages of robot_calibration give the pose of the board by its corners."""

import numpy as np
import pytest
from made_boards import make_board_poses
from support import refused

from elastocal.exchange.robot_calibration_csv import (
    is_robot_calibration,
    read_robot_calibration,
)

CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.08, 0], [0.1, 0.08, 0]])
NAMES = ["shoulder", "elbow"]


def make_messages(count=3):
    """Return the columns of messages by their headers."""
    angles, rotation, position = make_board_poses(count)
    columns = {"%time": range(count)}
    for joint, name in enumerate(NAMES):
        columns[f"field.joint_states.name{joint}"] = count * [name]
    for joint in range(len(NAMES)):
        columns[f"field.joint_states.position{joint}"] = angles[:, joint]
    seen = CORNERS @ rotation.transpose(0, 2, 1) + position[:, None]
    for sensor, (name, points) in enumerate(
        {"camera": seen, "arm": np.tile(CORNERS, (count, 1, 1))}.items()
    ):
        columns[f"field.observations{sensor}.sensor_name"] = count * [name]
        for corner, axis in np.ndindex(points.shape[1:]):
            header = f"field.observations{sensor}.features{corner}.point.{'xyz'[axis]}"
            columns[header] = points[:, corner, axis]
    return columns


def write(path, columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_poses_and_joint_angles_are_read_in_the_order_of_the_robots_joints(tmp_path):
    path = write(tmp_path / "data.csv", make_messages())
    assert is_robot_calibration(path.read_text().split("\n")[0])
    poses = read_robot_calibration(path, "camera", NAMES[::-1])
    angles, rotation, position = make_board_poses(3)
    np.testing.assert_allclose(poses.rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(poses.position, position, atol=1e-9)
    np.testing.assert_allclose(poses.angles, angles[:, 1::-1])


@pytest.mark.parametrize(
    ("drop", "sensor", "names", "phrases"),
    [
        ("name1", "camera", NAMES, ["no joint elbow"]),
        ("position1", "camera", (), ["no joint states", "rostopic"]),
        ("", "head", (), ["corners of camera, arm", "--sensor NAME"]),
        ("observations1.features3", "camera", (), ["4 corners", "3 of arm"]),
    ],
)
def test_an_incomplete_message_is_refused(tmp_path, drop, sensor, names, phrases):
    columns = make_messages()
    kept = {
        header: column
        for header, column in columns.items()
        if not drop or drop not in header
    }
    path = write(tmp_path / "data.csv", kept)
    with refused(path, "message 1", *phrases):
        read_robot_calibration(path, sensor, names)
