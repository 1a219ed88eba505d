"""Poses of a board in a camera, as programs for hand-eye calibration save them, and the
measurements of a campaign that they are.

With the camera on the robot the target is the camera; with the board on the robot it is the
board. A row has the pose of the board in the camera in either case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.campaigns.campaign import DEFAULT_HOLDOUT, GEOMETRY, ROBOT_FILE
from elastocal.campaigns.measurements import (
    POSITION,
    ROTATION,
    tabulate_single_measurements,
)
from elastocal.errors import InputError
from elastocal.measuring.board import ON_ROBOT

# Rotation matrices that are written with three decimals deviate by less.
_LARGEST_DEVIATION = 5e-3
# A camera that measures boards stands nearer; a larger distance is in millimetres.
_LARGEST_DISTANCE_M = 20.0
# Rough noise of a pose of a board, for campaigns whose program states none: a tenth of a
# pixel at half a metre, and what the FR3's poses in data/measured scatter.
NOISE = {"position_m": 1.0e-3, "orientation_rad": 2.0e-3}


@dataclass(frozen=True)
class BoardPoses:
    """N poses of a board in a camera's frame.

    Attributes
    ----------
    source : file of the poses.
    position : (N, 3) array, m.
    rotation : (N, 3, 3) array.
    angles : (N, n) array of joint angles, rad, where the file has them.
    joint_names : names of the joints in the order of `angles`, where the file has them.
    images : names of the images, where the file has them.
    noise : as in ``campaign.yaml``, where the file states any.
    """

    source: str
    position: np.ndarray
    rotation: np.ndarray
    angles: np.ndarray | None = None
    joint_names: tuple[str, ...] = ()
    images: tuple[str, ...] = ()
    noise: Mapping[str, float] | None = None


def check_poses(poses: BoardPoses) -> None:
    """Refuse poses that no camera measures: an InputError that names the sample."""
    deviation = np.abs(
        poses.rotation @ poses.rotation.transpose(0, 2, 1) - np.eye(3)
    ).max(axis=(1, 2), initial=0.0)
    distance = np.linalg.norm(poses.position, axis=1)
    checks = (
        (~np.isfinite(distance), "a position that is no number", "three numbers in m"),
        (
            ~(deviation < _LARGEST_DEVIATION),
            "a matrix that is no rotation",
            "a rotation matrix, row by row",
        ),
        (
            np.linalg.det(poses.rotation) < 0.0,
            "a mirrored rotation (determinant -1)",
            "a rotation, determinant 1: the axes of the board as the camera sees them",
        ),
        (
            distance > _LARGEST_DISTANCE_M,
            "a board more than 20 m away",
            "metres; give millimetres with --lengths mm",
        ),
    )
    for is_wrong, problem, allowed in checks:
        if is_wrong.any():
            sample = int(np.argmax(is_wrong)) + 1
            raise InputError(poses.source, f"sample {sample}", problem, allowed)


def tabulate_board_poses(poses: BoardPoses, camera: str) -> dict[str, np.ndarray]:
    """Return the columns of ``measurements.csv``, one row for each pose of the board in
    the camera.

    Parameters
    ----------
    poses : checked poses with joint angles.
    camera : where the camera is, as in ``campaign.yaml``.
    """
    if poses.angles is None:
        allowed = "--joints FILE: a table with q1, q2 and so on, a row for each sample"
        raise InputError(poses.source, "", "no joint angles", allowed)
    table = tabulate_single_measurements(poses.angles, name_target(camera))
    table |= dict(zip(POSITION, poses.position.T, strict=True))
    vector = Rotation.from_matrix(poses.rotation).as_rotvec()
    return table | dict(zip(ROTATION, vector.T, strict=True))


def describe_board_campaign(
    name: str, point: str, camera: str, noise: Mapping[str, float] | None = None
) -> dict[str, Any]:
    """Return ``campaign.yaml`` of poses of a board, with robot.yaml beside it.

    Parameters
    ----------
    name : name of the campaign.
    point : measuring point of the robot behind which the camera or the board sits.
    camera : where the camera is, as in ``campaign.yaml``.
    noise : as in ``campaign.yaml``; None: `NOISE`.
    """
    mount = {"point": point, "offset_m": "unknown", "rotation": "unknown"}
    return {
        "campaign": name,
        "robot": ROBOT_FILE,
        "measured": "board",
        "camera": camera,
        "frame": "unknown",
        "targets": {name_target(camera): mount},
        "compliance": "nominal",
        "declared": [*GEOMETRY],
        "noise": dict(noise or NOISE),
        "holdout": {**DEFAULT_HOLDOUT},
    }


def name_target(camera: str) -> str:
    """Return the name of the target on the robot."""
    return "camera" if camera == ON_ROBOT else "board"
