"""One coordinate of the target along an unknown axis, as a dial gauge reads it.

The zero of the gauge is unknown too.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from elastocal.measuring.plane import Plane
from elastocal.measuring.protocol import (
    Feature,
    Prediction,
    Sensor,
    predict_position,
    read_direction,
)


class Line(Plane):
    """Coordinate of the target along an axis, m.

    It is the height over a plane that is normal to the axis. Only the start differs,
    because the measurements of a gauge differ from each other.
    """

    name = "line"
    meaning = "coordinate of the target along an unknown axis: a dial gauge"
    error = "error of the reading"
    touches = False
    direction_key = "axis"
    keys: ClassVar = {
        "axis": "[x, y, z] in which the measurement grows, roughly, or unknown",
        "axis_std_rad": "standard deviation of the stated axis; left out it is rough",
    }
    sensor = Sensor("dial gauge", 1e-5)
    # The plate that the gauge touches is small, and its stroke is short.
    limits: ClassVar = {"extent_m": 0.05, "stroke_m": 0.02}

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Start at the stated axis, or at the gradient of the measurements."""
        centre = position.mean(axis=0)
        axis = read_direction(feature, self.direction_key)
        if axis is None:
            change = numbers[:, 0] - numbers[:, 0].mean()
            axis = np.linalg.lstsq(position - centre, change, rcond=None)[0]
            axis = axis / np.linalg.norm(axis) if axis.any() else np.eye(3)[2]
        return np.array([*axis, axis @ centre - numbers[:, 0].mean()])

    def aim(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> Prediction:
        """Predict how far the plate is from the middle of the stroke."""
        nothing = np.zeros((len(position), 3, 0))
        return predict_position(place[:3] - position, nothing)

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check that the gauge touches the plate within its stroke."""
        from_middle = position - place[:3]
        along = from_middle @ place[3:]
        across = np.linalg.norm(from_middle - along[:, None] * place[3:], axis=1)
        return {
            "the gauge misses the plate (extent_m)": across <= options["extent_m"],
            "the gauge is beyond its stroke (stroke_m)": 2.0 * np.abs(along)
            <= options["stroke_m"],
        }


LINE = Line()
