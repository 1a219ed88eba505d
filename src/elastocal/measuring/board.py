"""Pose of a board that a camera sees, with the camera on the robot or beside it.

With the camera on the robot (eye in hand) the target is the camera and the frame of the
session is the board. With the camera beside the robot (eye to hand) the target is the
board and the frame of the session is the camera.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.measuring.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import numpy as np

# Values of ``camera`` of campaign.yaml.
ON_ROBOT = "on_robot"
BESIDE_ROBOT = "beside_robot"


class Board(Pose):
    """Pose of a board in the frame of a camera."""

    name = "board"
    meaning = "pose of a board in the camera's optical frame"

    def convert(
        self,
        position: np.ndarray,
        rotation: np.ndarray | None,
        options: Mapping[str, Any],
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Convert poses of the board in the camera to poses of the target."""
        if options.get("camera", ON_ROBOT) == BESIDE_ROBOT or rotation is None:
            return position, rotation
        inverse = rotation.transpose(0, 2, 1)
        return -(inverse @ position[..., None])[..., 0], inverse


BOARD = Board()
