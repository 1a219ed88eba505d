"""One coordinate of the target along an unknown axis, as a dial gauge reads it.

The zero of the gauge is unknown too.
"""

from typing import ClassVar

import numpy as np

from elastocal.measuring.plane import Plane
from elastocal.measuring.protocol import Feature, read_direction


class Line(Plane):
    """Coordinate of the target along an axis, m.

    It is the height over a plane that is normal to the axis. Only the start differs,
    because the measurements of a gauge differ from each other.
    """

    name = "line"
    meaning = "coordinate of the target along an unknown axis: a dial gauge"
    touches = False
    direction_key = "axis"
    keys: ClassVar = {
        "axis": "[x, y, z] in which the measurement grows, roughly, or unknown"
    }

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


LINE = Line()
