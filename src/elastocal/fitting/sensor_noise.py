"""Sensor noise of measurements that are not all alike: by kind, direction and range."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations
    from elastocal.measuring.protocol import Kind, NoiseShape

# Median of the square of a standard normal number.
_MEDIAN_OF_SQUARES = 0.4549364
# No sensor repeats better than this, m or rad: a sixtieth of the wavelength of a laser.
FINEST_RESOLUTION = 1e-8


@dataclass(frozen=True)
class ShapedNoise:
    """Noise of a kind that states its shape, with estimated sizes.

    Attributes
    ----------
    kind : Kind
    options : what the shape depends on besides the poses, as of `Kind.refer_noise`
    factors : (G,) array, standard deviation of each group of errors, m or rad
    reference_m : float
        RMS standard deviation of a coordinate that is read, such as that of the board in
        the camera. The noise of a fit scales all factors by what it has instead.
    """

    kind: Kind
    options: Mapping[str, Any]
    factors: np.ndarray
    reference_m: float = 1.0

    def describe(self, observations: Observations) -> NoiseShape:
        """Describe the shape of the noise of observations."""
        assert observations.rotation is not None
        shape = self.kind.shape_noise(
            observations.position, observations.rotation, self.options
        )
        assert shape is not None
        return shape

    def compute_roots(self, observations: Observations) -> np.ndarray:
        """Compute roots (M, r, r) of the covariances, in the axes of the session."""
        shape = self.describe(observations)
        return shape.axes * (shape.sizes * self.factors[shape.groups])[:, None]

    def refer(self, observations: Observations) -> ShapedNoise:
        """State the RMS standard deviation of a coordinate of what is read."""
        return replace(self, reference_m=float(self.average(observations)[0]))

    def declare(self, observations: Observations, noise: Noise) -> ShapedNoise:
        """Scale the errors of position and those of rotation to declared noise, which is
        the RMS of what is read. Only ratios within each of the two remain estimated."""
        shape = self.describe(observations)
        declared = np.array([noise.position_m, noise.orientation_rad])
        scale = np.repeat(declared / self.average(observations), 3)
        factors = self.factors.copy()
        factors[shape.groups] *= scale
        return replace(self, factors=factors, reference_m=noise.position_m)

    def average(self, observations: Observations) -> np.ndarray:
        """RMS standard deviations (2,) of the coordinates and of the rotations that are
        read, m and rad."""
        shape = self.describe(observations)
        deviations = shape.sizes * self.factors[shape.groups]
        return np.sqrt((deviations.reshape(-1, 2, 3) ** 2).mean(axis=(0, 2)))


def compute_sensor_roots(
    model: Model, estimate: Estimate, observations: Observations, noise: Noise
) -> np.ndarray | None:
    """Compute a root of the sensor's covariance of each observation.

    Parameters
    ----------
    model, estimate : the frames of sessions turn the noise into base axes
    observations : M observations
    noise : Noise of a single measurement

    Returns
    -------
    (M, rows, rows) array or None
        None if all measurements have the same noise in all directions.
    """
    rows = observations.rows
    if model.shaped_noise is None:
        if observations.spread is None:
            return None
        deviations = observations.spread[:, None] * noise.sensor_std(rows)
        return deviations[:, None] * np.eye(rows)
    shaped = model.shaped_noise
    scale = noise.position_m / shaped.reference_m
    roots = shaped.compute_roots(observations)
    return scale * _turn_into_base(estimate, observations, roots)


def compute_target_std_m(
    model: Model, estimate: Estimate, observations: Observations, noise: Noise
) -> float:
    """Compute the standard deviation, m, of a coordinate of the target in a measurement.

    It is that of what is read, unless the pose of the target is converted from it: then
    it is the RMS over the observations.
    """
    if model.shaped_noise is None:
        return noise.position_m
    roots = compute_sensor_roots(model, estimate, observations, noise)
    assert roots is not None
    return float(np.sqrt((roots[:, :3] ** 2).sum(axis=2).mean()))


def compute_sensor_axes(
    model: Model, estimate: Estimate, observations: Observations
) -> np.ndarray | None:
    """Compute the residual (M, rows, rows), in base axes, that a unit of each error of
    what is read causes; None if the residual is that error."""
    if model.shaped_noise is None:
        return None
    axes = model.shaped_noise.describe(observations).axes
    return _turn_into_base(estimate, observations, axes)


def _turn_into_base(
    estimate: Estimate, observations: Observations, columns: np.ndarray
) -> np.ndarray:
    """Turn columns (M, 6, C) from the axes of the session into base axes."""
    session = estimate.index_sessions(observations)
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    turned = [into_base @ columns[:, :3], into_base @ columns[:, 3:]]
    return np.concatenate(turned, axis=1)


def standardize_residual(
    residual: np.ndarray, noise: Noise, roots: np.ndarray | None
) -> np.ndarray:
    """Divide residuals (M, rows) by the standard deviations of the sensor."""
    if roots is None:
        return residual / noise.sensor_std(residual.shape[1])
    return np.asarray(np.linalg.solve(roots, residual[..., None])[..., 0])


def estimate_factors(
    shaped: ShapedNoise, observations: Observations, residual: np.ndarray
) -> ShapedNoise:
    """Estimate the standard deviation of each group of errors from residuals (M, r) in
    the axes of the session.

    The median of squares is robust against rows that are wrong.
    """
    shape = shaped.describe(observations)
    errors = np.linalg.solve(shape.axes, residual[..., None])[..., 0] / shape.sizes
    factors = []
    for group in range(shape.groups.max() + 1):
        squares = errors[:, shape.groups == group] ** 2
        deviation = np.sqrt(np.median(squares) / _MEDIAN_OF_SQUARES)
        factors.append(max(float(deviation), FINEST_RESOLUTION))
    return replace(shaped, factors=np.array(factors)).refer(observations)
