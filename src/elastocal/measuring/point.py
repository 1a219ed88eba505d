"""A ball in a socket, a tip in a cone: the target is where a place is.

A row has no number. It states that the target was at the place at these joint angles.
The place is exactly known, known with a standard deviation, or unknown.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from elastocal.measuring.protocol import (
    Feature,
    Kind,
    Prediction,
    Sensor,
    Unknown,
    check_approach,
    describe_point,
    deviate_point,
    predict_position,
    read_vector,
)


class Point(Kind):
    """Target in a place."""

    name = "point"
    holds_target = True
    meaning = "the target is in a place: a ball in a socket, a tip in a cone"
    error = "distance from the touched place"
    numbers = 3
    keys: ClassVar = {
        "position_m": "[x, y, z] in the frame of the session, or unknown",
        "std_m": "standard deviation of the stated coordinates: one number or three, "
        "0.0002 where it is left out, 0 where they are exact by definition",
    }
    sensor = Sensor(
        "ball in a printed socket, play stated by the makers of MUKCa", 1e-4
    )
    place_keys: ClassVar = {"x": None, "y": None, "z": None, "nx": 0, "ny": 0, "nz": 1}
    # A ball stays in a socket of half a sphere while the shaft clears its rim.
    limits: ClassVar = {"tilt_deg": 60.0}

    def unknowns(self, feature: Feature) -> tuple[Unknown, ...]:
        """List the coordinates of the place."""
        return describe_point(feature)

    def locate(self, feature: Feature) -> np.ndarray | None:
        """Return the stated place."""
        return read_vector(feature, "position_m")

    def find_middle(self, values: np.ndarray) -> np.ndarray:
        """Return the place."""
        return values

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Start at the stated place, or in the middle of the targets."""
        stated = read_vector(feature, "position_m")
        return position.mean(axis=0) if stated is None else stated

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict how far the target is from the place; see `Kind.evaluate`."""
        by_place = np.tile(-np.eye(3), (len(position), 1, 1))
        return predict_position(values - position, by_place)

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check that the shaft is in the opening of the socket."""
        return check_approach(rotation, place[3:], options["tilt_deg"])

    def deviate(self, feature: Feature, values: np.ndarray) -> np.ndarray:
        """Return how far the place is from where it was stated."""
        return deviate_point(feature, values)


POINT = Point()
