"""Files of poses of a board, whatever program wrote them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.board_poses import BoardPoses, check_poses
from elastocal.exchange.detected_poses import is_detected_poses, read_detected_poses
from elastocal.exchange.easy_handeye_samples import (
    is_easy_handeye_samples,
    read_easy_handeye_samples,
)
from elastocal.exchange.joint_files import IMAGE, JointAngles, read_joint_angles
from elastocal.exchange.moveit_samples import is_moveit_samples, read_moveit_samples
from elastocal.exchange.opencv_poses import read_opencv_poses
from elastocal.exchange.robot_calibration_csv import (
    is_robot_calibration,
    read_robot_calibration,
)
from elastocal.io.documents import parse_yaml
from elastocal.io.texts import read_text
from elastocal.mechanics.robot import Robot

PROGRAMS = (
    "a table of elastocal detect, samples of MoveIt (.yaml) or easy_handeye (.yaml,"
    " .samples), arrays of OpenCV (.npz), or data of robot_calibration (.csv)"
)
# How archives of numpy begin.
_ZIP = b"PK"
_LARGEST_BYTES = 100_000_000
# Sensor of robot_calibration whose corners are in the frame of the camera.
CAMERA_SENSOR = "camera"


@dataclass(frozen=True)
class BoardOptions:
    """What a file of poses leaves open.

    Attributes
    ----------
    joints : file of joint angles, if the poses come without.
    angles : unit of joint angles that state none, "deg" or "rad".
    lengths : unit of positions, "m" or "mm".
    sensor : name of the camera in data of robot_calibration.
    """

    joints: Path | None = None
    angles: str | None = None
    lengths: str = "m"
    sensor: str = CAMERA_SENSOR


def read_board_poses(
    path: str | Path, robot: Robot, options: BoardOptions
) -> BoardPoses:
    """Read poses of a board with the joint angles of each.

    Raises `InputError`: no program writes such a file, a pose is none, or poses and
    joint angles differ in number.
    """
    poses = _read_poses(Path(path), robot, options)
    if options.lengths == "mm":
        poses = replace(poses, position=1e-3 * poses.position)
    check_poses(poses)
    if options.joints is not None:
        joint_angles = read_joint_angles(options.joints, robot, options.angles)
        rows = _match_rows(poses, joint_angles, options.joints)
        poses = replace(poses, angles=joint_angles.angles[rows])
    elif poses.angles is not None and options.angles == "deg":
        poses = replace(poses, angles=np.radians(poses.angles))
    if poses.angles is not None and poses.angles.shape[1] != robot.commands:
        count = f"{poses.angles.shape[1]} joint angles in a sample"
        raise InputError(path, "", count, f"{robot.commands}, as the robot reports")
    return poses


def _match_rows(poses: BoardPoses, joint_angles: JointAngles, path: Path) -> np.ndarray:
    """Find the row of joint angles of each pose: by the image, or else by the order."""
    count = len(poses.position)
    if poses.images and joint_angles.images:
        row_of_image = {image: row for row, image in enumerate(joint_angles.images)}
        missing = [image for image in poses.images if image not in row_of_image]
        if missing:
            problem = f"no row of {missing[0]}"
            raise InputError(path, IMAGE, problem, "a row for each image with a pose")
        return np.array([row_of_image[image] for image in poses.images])
    if len(joint_angles.angles) != count:
        row_count = f"{len(joint_angles.angles)} rows of joint angles"
        allowed = f"{count}, one for each sample"
        if poses.images:
            allowed += f", or a column {IMAGE} with the names of the images"
        raise InputError(path, "", row_count, allowed)
    return np.arange(count)


def _read_poses(path: Path, robot: Robot, options: BoardOptions) -> BoardPoses:
    """Find out which program wrote a file, and read it."""
    try:
        with open(path, "rb") as file:
            beginning = file.read(2)
    except OSError as error:
        raise InputError(path, "", str(error.strerror), PROGRAMS) from None
    if beginning == _ZIP:
        return read_opencv_poses(path)
    text = read_text(path, _LARGEST_BYTES)
    header = text.partition("\n")[0]
    if is_detected_poses(header):
        return read_detected_poses(path)
    if is_robot_calibration(header):
        names = robot.joint_names or ()
        return read_robot_calibration(path, options.sensor, names)
    document = parse_yaml(text, path)
    if is_moveit_samples(document):
        return read_moveit_samples(document, path)
    if is_easy_handeye_samples(document):
        return read_easy_handeye_samples(document, path)
    raise InputError(path, "", "none of the known files", PROGRAMS)
