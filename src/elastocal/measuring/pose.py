"""Pose of a target in the frame of the session, as a tracker of six components has it.

Its position is as accurate as that of `position`; the angles of its probe are from [1].

[1] Hexagon, data sheet of the Leica T-Mac: rotation angles to 0.01 deg, which is 18 um
at 100 mm.
"""

import math

import numpy as np

from elastocal.measuring.position import TRACKER_ERROR, TRACKER_M
from elastocal.measuring.protocol import Kind, Prediction, Sensor
from elastocal.mechanics.kinematics import compute_pose_differences


class Pose(Kind):
    """Position (m) and orientation (rotation vector, rad) of a target."""

    name = "pose"
    meaning = "position and orientation of the target in the frame of the session"
    error = "position error"
    numbers = 6
    columns = ("x", "y", "z", "rx", "ry", "rz")
    sensor = Sensor(
        f"laser tracker and 6DoF probe, {TRACKER_ERROR} at 7.5 m and of 0.01° (Leica T-Mac)",
        TRACKER_M,
        math.radians(0.005),
    )

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict poses; see `Kind.evaluate`."""
        # Import scipy only here, because reading a campaign does not need it.
        from scipy.spatial.transform import Rotation

        count = len(position)
        measured = Rotation.from_rotvec(numbers[:, 3:6]).as_matrix()
        residual = compute_pose_differences(
            numbers[:, :3], measured, position, rotation
        )
        by_pose = np.tile(np.eye(6), (count, 1, 1))
        return Prediction(residual, by_pose, np.zeros((count, 6, 0)))


POSE = Pose()
