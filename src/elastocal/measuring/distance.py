"""Distance of the target from an anchor: a ball bar or a draw wire.

The anchor may be anywhere. A draw wire that does not start at zero has an unknown zero.
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
    describe_number,
    describe_point,
    deviate_point,
    find_centre,
    measure_distances,
    predict_along,
    read_number,
    read_vector,
)


class Distance(Kind):
    """Distance of the target from an anchor, m."""

    name = "distance"
    meaning = "distance of the target from an anchor: a ball bar or a draw wire"
    error = "error of the distance"
    numbers = 1
    columns = ("value",)
    keys: ClassVar = {
        "position_m": "anchor [x, y, z] in the frame of the session, or unknown",
        "std_m": "standard deviation of the stated coordinates, 0.0002 if left out",
        "zero_m": "measurement at no distance: 0 if left out, a number, or unknown",
        "zero_std_m": "standard deviation of the zero, 0 if left out",
    }
    sensor = Sensor("draw wire, 0.1 mm", 1e-4)
    place_keys: ClassVar = {"x": None, "y": None, "z": None}
    # Near the anchor the direction of a wire is uncertain; usual wires are 2 m long.
    limits: ClassVar = {"shortest_m": 0.1, "longest_m": 2.0}

    def unknowns(self, feature: Feature) -> tuple[Unknown, ...]:
        """List the coordinates of the anchor and the zero of the measurements."""
        defaults = {"zero_m": 0.0, "zero_std_m": 0.0}
        completed = Feature(
            feature.name, feature.kind, defaults | {**feature.stated}, feature.source
        )
        return (
            *describe_point(feature),
            describe_number(completed, "zero_m", "zero_std_m"),
        )

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Start at the solution of the linear equations of squared distances."""
        zero = _get_zero(feature)
        anchor = read_vector(feature, "position_m")
        if anchor is None:
            anchor = find_centre(position, numbers[:, 0] - zero)
        return np.array([*anchor, zero])

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict distances from the anchor; see `Kind.evaluate`."""
        distance, direction = measure_distances(position, values[:3])
        by_unknowns = np.column_stack([-direction, np.ones(len(position))])
        residual = numbers[:, 0] - (distance + values[3])
        return predict_along(residual, direction, by_unknowns)

    def convert_place(self, place: np.ndarray) -> np.ndarray:
        """Return the anchor, and no zero."""
        return np.array([*place, 0.0])

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check that the wire is neither too short nor too long."""
        distance = measure_distances(position, place)[0]
        return {
            "the target is too near to the anchor (shortest_m)": distance
            >= options["shortest_m"],
            "the target is too far from the anchor (longest_m)": distance
            <= options["longest_m"],
        }

    def deviate(self, feature: Feature, values: np.ndarray) -> np.ndarray:
        """Return how far anchor and zero are from what was stated."""
        of_zero = values[3] - _get_zero(feature)
        return np.array([*deviate_point(feature, values[:3]), of_zero])


def _get_zero(feature: Feature) -> float:
    """Return the reading at zero distance, m; zero if it is left out or unknown."""
    if "zero_m" not in feature.stated:
        return 0.0
    return read_number(feature, "zero_m") or 0.0


DISTANCE = Distance()
