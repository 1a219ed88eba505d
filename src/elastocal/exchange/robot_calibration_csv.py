"""Calibration data of robot_calibration, exported from its bag as CSV [1]_.

A message contains the joint states and the corners of a board from each sensor. The
sensor of the camera states the corners in the camera's frame, the sensor of the arm in
the frame of the board. The pose of the board is the rigid motion between the two.

References
----------
.. [1] ``rostopic echo -b calibration_data.bag -p /calibration_data > data.csv``
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.board_poses import BoardPoses
from elastocal.mechanics.kinematics import align_points

_JOINT = re.compile(r"field\.joint_states\.(name|position)(\d+)")
_POINT = re.compile(r"field\.observations(\d+)\.features(\d+)\.point\.([xyz])")
_SENSOR = "field.observations{}.sensor_name"
_ALLOWED = "rostopic echo -b calibration_data.bag -p /calibration_data > data.csv"
# Smallest number of corners that determines a pose.
_FEWEST_POINTS = 3


def is_robot_calibration(header: str) -> bool:
    """Whether a line is the header of such a file."""
    return header.startswith("%time") and "field.observations0." in header


def read_robot_calibration(
    path: str | Path, camera_sensor: str, joint_names: Sequence[str] = ()
) -> BoardPoses:
    """Read poses of the board in the frame of a camera, and the joint angles.

    Parameters
    ----------
    path : file of the messages.
    camera_sensor : name of the camera among the sensors.
    joint_names : joints of the chain in their order; empty: all, in the file's order.

    Raises
    ------
    InputError
        If the file is not such an export, or a message lacks a joint, the camera or
        the corners in the frame of the board.
    """
    with open(path, encoding="utf-8", newline="") as file:
        messages = list(csv.DictReader(file))
    if not messages:
        raise InputError(path, "", "no message", _ALLOWED)
    positions = []
    rotations = []
    angles = []
    names = tuple(joint_names)
    for number, message in enumerate(messages, 1):
        key = f"message {number}"
        states = _read_joints(message, path, key)
        names = names or tuple(states)
        missing = [name for name in names if name not in states]
        if missing:
            raise InputError(path, key, f"no joint {missing[0]}", ", ".join(states))
        angles.append([states[name] for name in names])
        in_camera, on_board = _read_corners(message, camera_sensor, path, key)
        rotation, position = align_points(on_board, in_camera)
        rotations.append(rotation)
        positions.append(position)
    return BoardPoses(
        Path(path).as_posix(),
        np.array(positions),
        np.array(rotations),
        np.array(angles),
        names,
    )


def _read_joints(
    message: Mapping[str, str], path: str | Path, key: str
) -> dict[str, float]:
    """Read the angles of all joints by their names, rad."""
    fields: dict[str, dict[str, str]] = {"name": {}, "position": {}}
    for column, text in message.items():
        match = _JOINT.fullmatch(column or "")
        if match and text:
            fields[match[1]][match[2]] = text
    try:
        return {
            name: float(fields["position"][index])
            for index, name in fields["name"].items()
        }
    except (KeyError, ValueError):
        raise InputError(path, key, "no joint states", _ALLOWED) from None


def _read_corners(
    message: Mapping[str, str], camera_sensor: str, path: str | Path, key: str
) -> tuple[np.ndarray, np.ndarray]:
    """Read the corners in the frame of the camera and in that of the board, (M, 3), m."""
    corners = _read_corners_of_sensors(message, path, key)
    arm_sensors = [sensor for sensor in corners if sensor != camera_sensor]
    if camera_sensor not in corners or not arm_sensors:
        sensors = f"corners of {', '.join(corners) or 'no sensor'}"
        allowed = (
            f"{camera_sensor} (--sensor NAME) and one with the board's own corners"
        )
        raise InputError(path, key, sensors, allowed)
    in_camera = corners[camera_sensor]
    on_board = corners[arm_sensors[0]]
    if len(in_camera) != len(on_board) or len(in_camera) < _FEWEST_POINTS:
        counts = (
            f"{len(in_camera)} corners of {camera_sensor},"
            f" {len(on_board)} of {arm_sensors[0]}"
        )
        raise InputError(path, key, counts, "the same number of at least 3")
    return in_camera, on_board


def _read_corners_of_sensors(
    message: Mapping[str, str], path: str | Path, key: str
) -> dict[str, np.ndarray]:
    """Read the corners (M, 3) of each sensor, by its name."""
    coordinates: dict[str, dict[tuple[int, str], float]] = {}
    for column, text in message.items():
        match = _POINT.fullmatch(column or "")
        if match and text:
            sensor = message.get(_SENSOR.format(match[1]), match[1])
            try:
                number = float(text)
            except ValueError:
                problem = f"{text!r} in {column}"
                raise InputError(path, key, problem, "a number") from None
            coordinates.setdefault(sensor, {})[int(match[2]), match[3]] = number
    corners = {}
    for sensor, by_axis in coordinates.items():
        numbers = [by_axis[index] for index in sorted(by_axis)]
        corners[sensor] = np.array(numbers[: 3 * (len(numbers) // 3)]).reshape(-1, 3)
    return corners
