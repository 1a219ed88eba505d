"""Position of a target in the frame of the session, as a laser tracker measures it.

The standard deviation of its usual sensor is half of the largest error that its maker
permits, which a tracker's manual calls typical [1].

[1] Hexagon, Leica Absolute Tracker AT500 User Manual, section 2.8: transverse error at
most 15 um + 6 um/m, typical results half of that.
"""

import numpy as np

from elastocal.measuring.protocol import Kind, Prediction, Sensor, predict_position

# Half of 15 um + 6 um/m at 7.5 m.
TRACKER_M = 30e-6
TRACKER_ERROR = "half of MPE 15 µm + 6 µm/m"


class Position(Kind):
    """Position of a target, m."""

    name = "position"
    meaning = "position of the target in the frame of the session"
    error = "position error"
    numbers = 3
    columns = ("x", "y", "z")
    sensor = Sensor(
        f"laser tracker and reflector at 7.5 m, {TRACKER_ERROR} (Leica AT500)",
        TRACKER_M,
    )

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
