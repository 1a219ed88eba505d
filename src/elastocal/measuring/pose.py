"""Pose of a target in the frame of the session, as a tracker of six components has it."""

import numpy as np

from elastocal.measuring.protocol import Kind, Prediction
from elastocal.mechanics.kinematics import compute_pose_differences


class Pose(Kind):
    """Position (m) and orientation (rotation vector, rad) of a target."""

    name = "pose"
    meaning = "position and orientation of the target in the frame of the session"
    numbers = 6
    columns = ("x", "y", "z", "rx", "ry", "rz")

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
