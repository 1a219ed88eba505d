"""Position of a target in the frame of the session, as a laser tracker measures it."""

import numpy as np

from elastocal.measuring.protocol import Kind, Prediction, predict_position


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
        residual = numbers[:, :3] - position
        return predict_position(residual, np.zeros((len(position), 3, 0)))


POSITION = Position()
