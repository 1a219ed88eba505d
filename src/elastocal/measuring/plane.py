"""A tip on a plane: a granite table, a face of a cube, a wall that a probe touches.

The number is the height of the target over the plane, zero where it touches: the
radius of a touching ball shifts the plane and nothing else.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from elastocal.measuring.protocol import (
    ANYWHERE_M,
    ANYWHERE_RAD,
    Feature,
    Kind,
    Prediction,
    Sensor,
    Unknown,
    check_approach,
    predict_along,
    read_direction,
    read_std,
    refuse_key,
    span_plane,
)


class Plane(Kind):
    """Height of the target over a plane, m."""

    name = "plane"
    meaning = "height of the target over an unknown plane, 0 where it touches"
    error = "distance from the plane"
    numbers = 1
    columns = ("value",)
    touches = True
    direction_key = "normal"
    keys: ClassVar = {
        "normal": "[x, y, z] out of the plane towards the robot, roughly, or unknown",
        "normal_std_rad": "standard deviation of the stated normal; left out it is rough",
    }
    sensor = Sensor("tip on a granite table, whose form is 0.05 mm", 5e-5)
    place_keys: ClassVar = {"x": None, "y": None, "z": None, "nx": 0, "ny": 0, "nz": 1}
    # A table or the face of a block is no larger, and a shaft does not lie on it.
    limits: ClassVar = {"extent_m": 0.5, "tilt_deg": 60.0}

    def unknowns(self, feature: Feature) -> tuple[Unknown, ...]:
        """List two tilts and the height of the plane."""
        direction = read_direction(feature, self.direction_key)
        std_key = f"{self.direction_key}_std_rad"
        plausible_rad = ANYWHERE_RAD
        std_rad = None
        if std_key in feature.stated:
            if direction is None:
                allowed = f"{self.direction_key} beside it"
                raise refuse_key(feature, std_key, allowed)
            std_rad = float(read_std(feature, std_key)[0])
            plausible_rad = std_rad
        return (
            Unknown("tilt1", "rad", plausible_rad, std_rad),
            Unknown("tilt2", "rad", plausible_rad, std_rad),
            Unknown("height", "m", ANYWHERE_M),
        )

    def deviate(self, feature: Feature, values: np.ndarray) -> np.ndarray:
        """Return how far the normal is tilted from where it was stated, rad."""
        direction = read_direction(feature, self.direction_key)
        if direction is None:
            return np.zeros(3)
        return np.array([*(span_plane(direction) @ values[:3]), 0.0])

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Start at the plane through the targets; values are normal and height."""
        centre = position.mean(axis=0)
        axes = np.linalg.svd(position - centre, full_matrices=True)[2]
        normal = axes[-1]
        stated = read_direction(feature, self.direction_key)
        if stated is not None:
            normal = stated
        elif normal[np.argmax(np.abs(normal))] < 0.0:
            normal = -normal
        return np.array([*normal, normal @ centre - numbers[:, 0].mean()])

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict heights over the plane; see `Kind.evaluate`."""
        normal = values[:3]
        height = position @ normal - values[3]
        by_unknowns = np.column_stack(
            [position @ span_plane(normal).T, -np.ones(len(position))]
        )
        return predict_along(numbers[:, 0] - height, normal, by_unknowns)

    def state_place(self, place: np.ndarray) -> dict[str, Any]:
        """Return the rough normal."""
        return {self.direction_key: place[3:].tolist()}

    def convert_place(self, place: np.ndarray) -> np.ndarray:
        """Convert a point (3,) of the plane and its normal (3,) to normal and height."""
        return np.array([*place[3:], place[3:] @ place[:3]])

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check that the tip touches the face, and comes from outside."""
        distance = np.linalg.norm(position - place[:3], axis=1)
        is_on_face = distance <= options["extent_m"]
        return {
            "the tip is beyond the face (extent_m)": is_on_face,
            **check_approach(rotation, place[3:], options["tilt_deg"]),
        }

    def state(self, values: np.ndarray) -> np.ndarray:
        """Return the direction cosines of the normal with x and y, and the height."""
        return values[[0, 1, 3]]

    def move(self, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Tilt the normal and lift the plane."""
        normal = values[:3] + step[:2] @ span_plane(values[:3])
        return np.array([*(normal / np.linalg.norm(normal)), values[3] + step[2]])


PLANE = Plane()
