"""Distance of the target from an anchor: a ball bar or a draw wire.

The anchor may be anywhere. A draw wire that does not start at zero has an unknown zero.
"""

from typing import ClassVar

import numpy as np

from elastocal.measuring.protocol import (
    Feature,
    Kind,
    Prediction,
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
    numbers = 1
    columns = ("value",)
    keys: ClassVar = {
        "position_m": "anchor [x, y, z] in the frame of the session, or unknown",
        "std_m": "standard deviation of the stated coordinates, 0.0002 if left out",
        "zero_m": "measurement at no distance: 0 if left out, a number, or unknown",
        "zero_std_m": "standard deviation of the zero, 0 if left out",
    }

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
