"""A tip on a sphere: a calibration ball that a probe touches.

The number is the height of the target over the sphere, zero where it touches. The
radius contains that of the tip.
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
    describe_number,
    describe_point,
    deviate_point,
    find_centre,
    measure_distances,
    predict_along,
    read_number,
    read_std,
    read_vector,
)

# Contacts with lengths that are less exact than those of a robot, a millimetre in 2.5 m,
# do not show its scale: N of them make it smaller by N times the variance of the scale.
_EXACT_SHARE = 4e-4


class Sphere(Kind):
    """Height of the target over a sphere, m."""

    name = "sphere"
    meaning = "height of the target over an unknown sphere, 0 where it touches"
    error = "distance from the sphere"
    numbers = 1
    columns = ("value",)
    touches = True
    keys: ClassVar = {
        "position_m": "centre [x, y, z] in the frame of the session, or unknown",
        "std_m": "standard deviation of the stated coordinates, 0.0002 if left out",
        "radius_m": "radius of the sphere and of the tip together, or unknown",
        "radius_std_m": "standard deviation of the stated radius, 0.0002 if left out",
    }
    sensor = Sensor("touch probe on a calibration ball", 1e-5)
    place_keys: ClassVar = {"x": None, "y": None, "z": None, "radius": None}
    # The shaft of a probe comes from outside of the ball.
    limits: ClassVar = {"tilt_deg": 60.0}

    def unknowns(self, feature: Feature) -> tuple[Unknown, ...]:
        """List centre and radius."""
        return (
            *describe_point(feature),
            describe_number(feature, "radius_m", "radius_std_m"),
        )

    def states_length(self, feature: Feature) -> bool:
        """Whether centre or radius are known to a smaller share than the robot."""
        centre = read_vector(feature, "position_m")
        radius_m = read_number(feature, "radius_m")
        lengths = [
            (0.0 if centre is None else float(np.linalg.norm(centre)), "std_m", 3),
            (radius_m or 0.0, "radius_std_m", 1),
        ]
        return any(
            read_std(feature, std_key, count).max() < _EXACT_SHARE * length_m
            for length_m, std_key, count in lengths
        )

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Start at the sphere through the targets, fitted algebraically [1]_.

        References
        ----------
        .. [1] Pratt, Direct least-squares fitting of algebraic surfaces, 1987.
        """
        centre = read_vector(feature, "position_m")
        if centre is None:
            centre = find_centre(position, np.zeros(len(position)))
        radius = read_number(feature, "radius_m")
        if radius is None:
            distances = np.linalg.norm(position - centre, axis=1)
            radius = float((distances - numbers[:, 0]).mean())
        return np.array([*centre, radius])

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict heights over the sphere; see `Kind.evaluate`."""
        distance, direction = measure_distances(position, values[:3])
        by_unknowns = np.column_stack([-direction, -np.ones(len(position))])
        residual = numbers[:, 0] - (distance - values[3])
        return predict_along(residual, direction, by_unknowns)

    def convert_place(self, place: np.ndarray) -> np.ndarray:
        """Return centre and radius."""
        return place

    def check_poses(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        place: np.ndarray,
        options: Mapping[str, Any],
    ) -> dict[str, np.ndarray]:
        """Check that the tip comes from outside of the ball."""
        normal = measure_distances(position, place[:3])[1]
        return check_approach(rotation, normal, options["tilt_deg"])

    def deviate(self, feature: Feature, values: np.ndarray) -> np.ndarray:
        """Return how far centre and radius are from what was stated."""
        radius = read_number(feature, "radius_m")
        of_radius = 0.0 if radius is None else values[3] - radius
        return np.array([*deviate_point(feature, values[:3]), of_radius])


SPHERE = Sphere()
