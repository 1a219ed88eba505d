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
from elastocal.mechanics.kinematics import form_cross_matrices

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

# Values of ``camera`` of campaign.yaml.
ON_ROBOT = "on_robot"
BESIDE_ROBOT = "beside_robot"
# Lower bound on the cosine of the obliquity; no corners are detected on a board that is
# seen more obliquely.
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
        """Describe the noise of a pinhole camera that locates all corners equally well.

        The error of a corner is an angle of view. Errors of position across the optical
        axis are therefore proportional to the range. Those along the axis grow with the
        square of the range, because depth follows from the size of the board in the
        image. Errors of rotation grow with the range. Rotations about axes in the board
        also become less certain with obliquity, because an oblique board is narrower in
        the image. The rotation about the normal is the most certain one.
        """
        board_position, board_rotation = self.convert(position, rotation, options)
        range_m = np.linalg.norm(board_position, axis=1)
        ratio = (range_m / np.median(range_m))[:, None]
        normal = board_rotation[:, :, 2]
        cosine = np.abs((normal * board_position).sum(axis=1)) / range_m
        tilting = ratio / np.maximum(cosine, _GRAZING)[:, None]
        sizes = np.hstack([ratio, ratio, ratio**2, tilting, tilting, ratio])
        axes = np.zeros((len(board_position), 6, 6))
        axes[:, :3, :3] = np.eye(3)
        axes[:, 3:, 3:] = board_rotation
        if options.get("camera", ON_ROBOT) == ON_ROBOT:
            # The measured pose is that of the camera on the board: the inverse of the
            # pose of the board in the camera.
            inversion = np.zeros((len(board_position), 6, 6))
            inversion[:, :3, :3] = -rotation
            inversion[:, 3:, 3:] = -rotation
            inversion[:, :3, 3:] = -rotation @ form_cross_matrices(board_position)
            axes = inversion @ axes
        return NoiseShape(axes, sizes, np.array([0, 0, 1, 2, 2, 3]))


BOARD = Board()
