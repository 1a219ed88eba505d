"""Joint angles are read from tables and from what MoveIt saves."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from made_boards import PANDA, make_board_poses
from support import refused

from elastocal.campaigns.reading import read_robot
from elastocal.exchange.joint_files import read_joint_angles

ROBOT = read_robot(PANDA)
ANGLES, _, _ = make_board_poses(3)
NAMES = tuple(f"panda_joint{joint}" for joint in range(1, 8))
NAMED = replace(ROBOT, joint_names=NAMES)


@pytest.mark.parametrize(
    ("robot", "header", "unit", "scale"),
    [
        (ROBOT, ",".join(f"q{joint}" for joint in range(1, 8)), "rad", 1.0),
        (
            ROBOT,
            ",".join(f"J{joint} [deg]" for joint in range(1, 8)),
            None,
            180 / np.pi,
        ),
        (NAMED, ",".join(NAMES), "rad", 1.0),
    ],
)
def test_a_table_is_read(tmp_path, robot, header, unit, scale):
    path = tmp_path / "joints.csv"
    np.savetxt(path, scale * ANGLES, delimiter=",", header=header, comments="")
    np.testing.assert_allclose(read_joint_angles(path, robot, unit).angles, ANGLES)


def test_named_columns_may_stand_in_any_order(tmp_path):
    path = tmp_path / "joints.csv"
    # ROS publishes the names of joints in alphabetical order.
    header = ",".join(NAMES[::-1])
    np.savetxt(path, ANGLES[:, ::-1], delimiter=",", header=header, comments="")
    np.testing.assert_allclose(read_joint_angles(path, NAMED, "rad").angles, ANGLES)


def test_the_sheet_of_a_plan_gives_joint_angles_in_rad(tmp_path):
    path = tmp_path / "measurements.csv"
    degrees = [f"q{joint}_deg" for joint in range(1, 8)]
    plain = [f"q{joint}" for joint in range(1, 8)]
    # The sheet shows rounded degrees; the angles in rad are exact.
    shown = np.degrees(ANGLES).round(1)
    header = ",".join([*degrees, *plain])
    cells = np.hstack([shown, ANGLES])
    np.savetxt(path, cells, delimiter=",", header=header, comments="")
    np.testing.assert_allclose(read_joint_angles(path, ROBOT).angles, ANGLES)


def test_the_joint_without_a_column_is_named(tmp_path):
    path = tmp_path / "joints.csv"
    header = ",".join(NAMES[:-1])
    np.savetxt(path, ANGLES[:, :-1], delimiter=",", header=header, comments="")
    with refused(path, "header", "no column 'q7' or 'panda_joint7'", "a header with"):
        read_joint_angles(path, NAMED, "rad")


def test_joint_states_of_moveit_are_put_into_the_order_of_the_robot(tmp_path):
    path = tmp_path / "joints.yaml"
    document = {
        "joint_names": [*NAMES[::-1]],
        "joint_values": ANGLES[:, ::-1].tolist(),
    }
    path.write_text(yaml.safe_dump(document))
    np.testing.assert_array_equal(read_joint_angles(path, NAMED).angles, ANGLES)
    # Without names in the robot's file the order of the file counts.
    np.testing.assert_array_equal(
        read_joint_angles(path, ROBOT).angles, ANGLES[:, ::-1]
    )


def test_missing_joints_and_units_are_refused(tmp_path):
    path = tmp_path / "joints.csv"
    path.write_text("q1,q2\n0,1\n")
    with refused(path, "header", "no column 'q3'", "q1, q2"):
        read_joint_angles(path, ROBOT, "rad")
    np.savetxt(
        path,
        ANGLES,
        delimiter=",",
        header=",".join(f"q{joint}" for joint in range(1, 8)),
        comments="",
    )
    with refused(path, "header", "no unit", "--angles"):
        read_joint_angles(path, ROBOT)


@pytest.mark.parametrize(
    ("document", "key", "phrases"),
    [
        ({"joint_names": ["a"]}, "", ["no joint states", "joint_values"]),
        ({"joint_names": ["a"], "joint_values": [[1, 2]]}, "joint_values", ["(1, 2)"]),
        (
            {"joint_names": ["a"], "joint_values": [[1]]},
            "joint_names",
            ["1 joints", "7"],
        ),
    ],
)
def test_other_documents_are_refused(tmp_path, document, key, phrases):
    path = tmp_path / "joints.yaml"
    path.write_text(yaml.safe_dump(document))
    with refused(path, key, *phrases):
        read_joint_angles(path, ROBOT)


def test_a_column_of_images_is_kept(tmp_path):
    path = tmp_path / "joints.csv"
    header = ",".join(f"q{joint}" for joint in range(1, 8))
    rows = [f"{number}.png,{','.join(7 * ['0.1'])}" for number in range(2)]
    path.write_text("\n".join([f"image,{header}", *rows]) + "\n")
    assert read_joint_angles(path, ROBOT, "rad").images == ("0.png", "1.png")
    path.write_text("\n".join([f"image,{header}", *rows, rows[0]]) + "\n")
    with refused(path, "line 4, column image", "0.png in line 2 too", "one line"):
        read_joint_angles(path, ROBOT, "rad")
