"""Which program wrote a file of poses is found out, and the joint angles are joined."""

import numpy as np
import pytest
import yaml
from made_boards import PANDA, make_board_poses, stack_matrices
from scipy.spatial.transform import Rotation
from support import refused

from elastocal.campaigns.reading import read_robot
from elastocal.exchange.board_programs import BoardOptions, read_board_poses

ROBOT = read_robot(PANDA)
ANGLES, ROTATION, POSITION = make_board_poses(5)


def write_moveit(folder, scale=1.0):
    path = folder / "samples.yaml"
    matrices = stack_matrices(ROTATION, scale * POSITION)
    samples = [{"object_wrt_sensor": matrix.ravel().tolist()} for matrix in matrices]
    path.write_text(yaml.safe_dump(samples))
    return path


def write_easy_handeye(folder):
    path = folder / "mine.samples"
    quaternions = Rotation.from_matrix(ROTATION).as_quat().tolist()
    samples = []
    for vector, quaternion in zip(POSITION.tolist(), quaternions, strict=True):
        board = {
            "translation": dict(zip("xyz", vector, strict=True)),
            "rotation": dict(zip("xyzw", quaternion, strict=True)),
        }
        samples.append({"tracking": board})
    path.write_text(yaml.safe_dump({"samples": samples}))
    return path


def write_opencv(folder):
    path = folder / "calib.npz"
    np.savez(path, rvecs=Rotation.from_matrix(ROTATION).as_rotvec(), tvecs=POSITION)
    return path


def write_joints(folder, count=5):
    path = folder / "joints.csv"
    header = ",".join(f"q{joint}" for joint in range(1, 8))
    np.savetxt(path, ANGLES[:count], delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize("write", [write_moveit, write_easy_handeye, write_opencv])
def test_every_program_is_recognized(tmp_path, write):
    options = BoardOptions(joints=write_joints(tmp_path), angles="rad")
    poses = read_board_poses(write(tmp_path), ROBOT, options)
    np.testing.assert_allclose(poses.position, POSITION, atol=1e-12)
    np.testing.assert_allclose(poses.rotation, ROTATION, atol=1e-12)
    np.testing.assert_array_equal(poses.angles, ANGLES)


def test_millimetres_are_converted_if_stated_and_refused_if_not(tmp_path):
    path = write_moveit(tmp_path, scale=1000.0)
    poses = read_board_poses(path, ROBOT, BoardOptions(lengths="mm"))
    np.testing.assert_allclose(poses.position, POSITION)
    with refused(path, "sample 1", "20 m", "--lengths mm"):
        read_board_poses(path, ROBOT, BoardOptions())


def test_other_files_and_other_numbers_of_joint_angles_are_refused(tmp_path):
    joints = write_joints(tmp_path, 3)
    with refused(joints, "", "3 rows of joint angles", "5, one for each"):
        read_board_poses(
            write_moveit(tmp_path), ROBOT, BoardOptions(joints=joints, angles="rad")
        )
    path = tmp_path / "other.yaml"
    path.write_text("a: 1\n")
    with refused(path, "", "none of the known files", "MoveIt"):
        read_board_poses(path, ROBOT, BoardOptions())
    with refused(tmp_path / "none.yaml", "", "No such file"):
        read_board_poses(tmp_path / "none.yaml", ROBOT, BoardOptions())
    path = tmp_path / "six.npz"
    np.savez(
        path,
        rvecs=Rotation.from_matrix(ROTATION).as_rotvec(),
        tvecs=POSITION,
        q=ANGLES[:, :6],
    )
    with refused(path, "", "6 joint angles", "7, as the robot"):
        read_board_poses(path, ROBOT, BoardOptions())
