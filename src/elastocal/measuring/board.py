"""Pose of a board that a camera sees, with the camera on the robot or beside it.

With the camera on the robot (eye in hand) the target is the camera and the frame of the
session is the board. With the camera beside the robot (eye to hand) the target is the
board and the frame of the session is the camera.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.measuring.pose import Pose
from elastocal.measuring.protocol import NoiseShape

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

# Values of ``camera`` of campaign.yaml.
ON_ROBOT = "on_robot"
BESIDE_ROBOT = "beside_robot"
# Cosine of the obliquity below which no corner of a board is found.
_GRAZING = 0.2


class Board(Pose):
    """Pose of a board in the frame of a camera."""

    name = "board"
    meaning = "pose of a board in the camera's optical frame"

    is_converted = True

    def convert(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Convert poses of the board in the camera to poses of the target."""
        if options.get("camera", ON_ROBOT) == BESIDE_ROBOT:
            return position, rotation
        inverse = rotation.transpose(0, 2, 1)
        return -(inverse @ position[..., None])[..., 0], inverse

    def shape_noise(
        self, position: np.ndarray, rotation: np.ndarray, options: Mapping[str, Any]
    ) -> NoiseShape | None:
        """Describe the noise of a pinhole camera that sees corners with equal errors.

        A corner is off by an angle of the view. Across the optical axis the board is
        then off in proportion to the range, and along it by the square of the range,
        because depth follows from the size of the board in the image. Turns grow with
        the range. Those about axes in the board also grow with the obliquity, which
        narrows the board in the image; that about its normal is the most certain one.
        """
        is_on_robot = options.get("camera", ON_ROBOT) == ON_ROBOT
        seen, turned = self.convert(position, rotation, options)
        range_m = np.linalg.norm(seen, axis=1)
        share = (range_m / np.median(range_m))[:, None]
        facing = np.abs((turned[:, :, 2] * seen).sum(axis=1)) / range_m
        narrowed = share / np.maximum(facing, _GRAZING)[:, None]
        sizes = np.hstack([share, share, share**2, narrowed, narrowed, share])
        in_camera = np.zeros((len(seen), 6, 6))
        in_camera[:, :3, :3] = np.eye(3)
        in_camera[:, 3:, 3:] = turned
        axes = in_camera
        if is_on_robot:
            # The pose of the camera on the board is the inverse of what is seen.
            moved = np.zeros((len(seen), 6, 6))
            moved[:, :3, :3] = -rotation
            moved[:, 3:, 3:] = -rotation
            moved[:, :3, 3:] = -rotation @ _cross_matrices(seen)
            axes = moved @ in_camera
        return NoiseShape(axes, sizes, np.array([0, 0, 1, 2, 2, 3]))


def _cross_matrices(vectors: np.ndarray) -> np.ndarray:
    """Matrices (M, 3, 3) that multiply other vectors as vectors (M, 3) do from the left."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1)


BOARD = Board()
