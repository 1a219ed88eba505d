"""Calibration data of robot_calibration, exported from its bag as CSV [1]_.

A message has the joint states and, of each sensor, the corners of a board. The camera's
corners are in its own frame, the arm's in that of the board; the pose of the board is the
rigid motion between them [2]_.

References
----------
.. [1] ``rostopic echo -b calibration_data.bag -p /calibration_data > data.csv``
.. [2] Umeyama, Least-squares estimation of transformation parameters between two point
   patterns, IEEE Transactions on Pattern Analysis and Machine Intelligence 13, 1991.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.board_poses import BoardPoses

_JOINT = re.compile(r"field\.joint_states\.(name|position)(\d+)")
_POINT = re.compile(r"field\.observations(\d+)\.features(\d+)\.point\.([xyz])")
_SENSOR = "field.observations{}.sensor_name"
_ALLOWED = "rostopic echo -b calibration_data.bag -p /calibration_data > data.csv"
# Corners that determine a pose.
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
        seen, board = _read_corners(message, camera_sensor, path, key)
        rotation, position = _fit_rigid_motion(board, seen)
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
    parts: dict[str, dict[str, str]] = {"name": {}, "position": {}}
    for column, text in message.items():
        match = _JOINT.fullmatch(column or "")
        if match and text:
            parts[match[1]][match[2]] = text
    try:
        return {
            name: float(parts["position"][index])
            for index, name in parts["name"].items()
        }
    except (KeyError, ValueError):
        raise InputError(path, key, "no joint states", _ALLOWED) from None


def _read_corners(
    message: Mapping[str, str], camera_sensor: str, path: str | Path, key: str
) -> tuple[np.ndarray, np.ndarray]:
    """Read the corners as the camera has them and in the frame of the board, (M, 3)."""
    corners: dict[str, dict[tuple[int, str], float]] = {}
    for column, text in message.items():
        match = _POINT.fullmatch(column or "")
        if match and text:
            sensor = message.get(_SENSOR.format(match[1]), match[1])
            try:
                number = float(text)
            except ValueError:
                raise InputError(
                    path, key, f"{text!r} in {column}", "a number"
                ) from None
            corners.setdefault(sensor, {})[int(match[2]), match[3]] = number
    others = [sensor for sensor in corners if sensor != camera_sensor]
    if camera_sensor not in corners or not others:
        found = f"corners of {', '.join(corners) or 'no sensor'}"
        allowed = (
            f"{camera_sensor} (--sensor NAME) and one with the board's own corners"
        )
        raise InputError(path, key, found, allowed)
    points = []
    for sensor in (camera_sensor, others[0]):
        numbers = [corners[sensor][index] for index in sorted(corners[sensor])]
        points.append(np.array(numbers[: 3 * (len(numbers) // 3)]).reshape(-1, 3))
    seen, board = points
    if len(seen) != len(board) or len(seen) < _FEWEST_POINTS:
        found = f"{len(seen)} corners of {camera_sensor}, {len(board)} of {others[0]}"
        raise InputError(path, key, found, "the same number of at least 3")
    return seen, board


def _fit_rigid_motion(
    points: np.ndarray, moved: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit rotation (3, 3) and translation (3,) that move M points onto others."""
    centre = points.mean(axis=0)
    moved_centre = moved.mean(axis=0)
    left, _, right = np.linalg.svd((moved - moved_centre).T @ (points - centre))
    sign = np.sign(np.linalg.det(left @ right))
    rotation = left @ np.diag([1.0, 1.0, sign]) @ right
    return rotation, moved_centre - rotation @ centre
