"""A tip on a surface that is nearly flat: an ordinary table, a wall, a machine bed.

The form of the surface, its heights over a plane, is a smooth random field. Touches near
each other have nearly the same height, whatever the posture of the robot, so that the
form is distinguished from errors of the robot.

The field is a Gaussian process with a Matérn covariance (smoothness 3/2). It is written
as a sum of waves in a square around the touches, each with the variance that its
frequency has in the field [1]_. The amplitudes of the waves are unknowns with priors.

References
----------
.. [1] Solin and Särkkä, Hilbert space methods for reduced-rank Gaussian process
   regression, Statistics and Computing 30, 2020.
"""

from __future__ import annotations

import math
from typing import ClassVar, NamedTuple

import numpy as np

from elastocal.measuring.plane import Plane
from elastocal.measuring.protocol import (
    Feature,
    Prediction,
    Sensor,
    Unknown,
    predict_along,
    read_number,
    refuse_key,
    span_plane,
)

# Form of an ordinary table top or a wall: some tenths of a millimetre.
_FORM_STD_M = 3e-4
_LARGEST_FORM_M = 0.01
# Distance over which the form changes, of the width of the touched area: at two of five
# places along the area, the heights are then nearly independent. Longer waves are fitted
# as exactly with this length, shorter ones far better than with a larger one
# (benchmarks/wavy_planes.py).
_LENGTH_SHARE = 0.15
# Half the width of the square over that of the touched area: at its edge all waves are
# zero, which the touches must not notice.
_MARGIN = 1.4
# Half waves along one side: the shortest are half as long as the distance of five places.
_WAVES = 12
# Half the width of the square of a feature that is touched at one point, m.
_SMALLEST_M = 1e-3
# Where the values of a feature are, see `Surface`.
_NORMAL = slice(0, 4)
_MIDDLE = slice(4, 7)
_AXES = slice(7, 13)
_HALF_WIDTH = 13
_WAVES_FROM = 14


def _list_waves() -> np.ndarray:
    """List the half waves (K, 2) along both sides of the square, without those that are
    shorter than the shortest along one side."""
    numbers = np.arange(1, _WAVES + 1)
    pairs = np.stack(np.meshgrid(numbers, numbers), axis=-1).reshape(-1, 2)
    return pairs[(pairs**2).sum(axis=1) <= _WAVES**2 + 1]


def _compute_shares(waves: np.ndarray) -> np.ndarray:
    """Compute the variances (K,) of the amplitudes of waves in a field of unit variance.

    The spectral density of the field, at the frequency of each wave, over the area of a
    quarter of the square, of unit half width.
    """
    length = 2.0 * _LENGTH_SHARE / _MARGIN
    frequency = 0.5 * np.pi * np.sqrt((waves**2).sum(axis=1))
    rate = 3.0 / length**2
    density = 6.0 * math.pi * rate**1.5 * (rate + frequency**2) ** -2.5
    return np.asarray(density)


_WAVE_NUMBERS = _list_waves()
_SHARES = _compute_shares(_WAVE_NUMBERS)


class _Form(NamedTuple):
    """Waves at M positions.

    Attributes
    ----------
    heights : (M, K) array, height of each wave of unit amplitude.
    slopes : (M, K, 3) array, its gradient, 1/m, in the session.
    """

    heights: np.ndarray
    slopes: np.ndarray


class Surface(Plane):
    """Height of the target over a nearly flat surface, m.

    Values of a feature: normal (3) and height of its plane; the square of the waves: its
    middle (3), axes along both sides (6) and half width; amplitudes (K) of the waves.
    """

    name = "surface"
    meaning = "height of the target over a nearly flat surface, 0 where it touches"
    keys: ClassVar = {
        **Plane.keys,
        "form_std_m": "standard deviation of its heights, 0.0003 if left out",
    }
    sensor = Sensor("tip on a table, which repeats to 0.05 mm", 5e-5)

    def unknowns(self, feature: Feature) -> tuple[Unknown, ...]:
        """List two tilts, the height and the amplitudes of the waves."""
        deviations = (_read_form_std(feature) * np.sqrt(_SHARES)).tolist()
        amplitudes = [
            Unknown(f"form{number}", "m", std, std)
            for number, std in enumerate(deviations, 1)
        ]
        return (*super().unknowns(feature), *amplitudes)

    def deviate(self, feature: Feature, values: np.ndarray) -> np.ndarray:
        """Return how far the normal is tilted, rad, and the amplitudes."""
        of_plane = super().deviate(feature, values[_NORMAL])
        return np.array([*of_plane, *values[_WAVES_FROM:]])

    def start(
        self, feature: Feature, position: np.ndarray, numbers: np.ndarray
    ) -> np.ndarray:
        """Start at the plane through the targets, with a square around them."""
        plane = super().start(feature, position, numbers)
        middle = 0.5 * (position.min(axis=0) + position.max(axis=0))
        axes = span_plane(plane[:3])
        half_width = np.abs((position - middle) @ axes.T).max()
        return _lay_square(plane, middle, _MARGIN * max(half_width, _SMALLEST_M))

    def evaluate(
        self,
        position: np.ndarray,
        rotation: np.ndarray,
        numbers: np.ndarray,
        values: np.ndarray,
    ) -> Prediction:
        """Predict heights over the surface; see `Kind.evaluate`."""
        over_plane = super().evaluate(position, rotation, numbers, values[_NORMAL])
        form = _evaluate_waves(position, values)
        amplitudes = values[_WAVES_FROM:]
        residual = over_plane.residual[:, 0] + form.heights @ amplitudes
        gradient = values[:3] - amplitudes @ form.slopes
        by_unknowns = np.concatenate(
            [over_plane.by_unknowns[:, 0], -form.heights], axis=1
        )
        return predict_along(residual, gradient, by_unknowns)

    def convert_place(self, place: np.ndarray) -> np.ndarray:
        """Convert a point (3,) of the surface and its normal (3,) to a flat surface."""
        return _lay_square(super().convert_place(place), place[:3], 1.0)

    def state(self, values: np.ndarray) -> np.ndarray:
        """Return the direction cosines of the normal with x and y, the height and the
        amplitudes."""
        return np.array([*super().state(values[_NORMAL]), *values[_WAVES_FROM:]])

    def move(self, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Tilt the normal, lift the plane and change the amplitudes."""
        moved = values.copy()
        moved[_NORMAL] = super().move(values[_NORMAL], step[:3])
        moved[_WAVES_FROM:] += step[3:]
        return moved


def _read_form_std(feature: Feature) -> float:
    """Read the standard deviation of the heights of a surface, m."""
    if "form_std_m" not in feature.stated:
        return _FORM_STD_M
    std_m = read_number(feature, "form_std_m")
    if std_m is None or not 0.0 < std_m <= _LARGEST_FORM_M:
        allowed = f"more than 0 and {_LARGEST_FORM_M:g} m at most"
        raise refuse_key(feature, "form_std_m", allowed)
    return std_m


def _lay_square(
    plane: np.ndarray, middle: np.ndarray, half_width_m: float
) -> np.ndarray:
    """Make the values of a flat surface with a square about a point (3,)."""
    axes = span_plane(plane[:3]).ravel()
    amplitudes = np.zeros(len(_WAVE_NUMBERS))
    return np.array([*plane, *middle, *axes, half_width_m, *amplitudes])


def _evaluate_waves(position: np.ndarray, values: np.ndarray) -> _Form:
    """Evaluate the waves of a surface at positions (M, 3), m."""
    middle = values[_MIDDLE]
    axes = values[_AXES].reshape(2, 3)
    half_width = values[_HALF_WIDTH]
    frequency = 0.5 * np.pi * _WAVE_NUMBERS / half_width
    along = (position - middle) @ axes.T + half_width
    phase = along[:, None] * frequency
    sine = np.sin(phase)
    slope = frequency * np.cos(phase)
    by_sides = np.stack([slope[..., 0] * sine[..., 1], sine[..., 0] * slope[..., 1]], 2)
    return _Form(sine.prod(axis=2), by_sides @ axes)


SURFACE = Surface()
