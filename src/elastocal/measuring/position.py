"""Position of a target in the frame of the session, as a laser tracker measures it."""

import numpy as np

from elastocal.measuring.protocol import Kind, Prediction


class Position(Kind):
    """Position of a target, m."""

    name = "position"
    meaning = "position of the target in the frame of the session"
    numbers = 3
    columns = ("x", "y", "z")

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict positions; see `Kind.evaluate`."""
        count = len(position)
        by_pose = np.zeros((count, 3, 6))
        by_pose[:, :, :3] = np.eye(3)
        return Prediction(numbers[:, :3] - position, by_pose, np.zeros((count, 3, 0)))


POSITION = Position()
