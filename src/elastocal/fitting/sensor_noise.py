"""Sensor noise of measurements that are not all alike: by kind, direction and range."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations
    from elastocal.measuring.protocol import Kind, NoiseShape

# Median of the square of a standard normal number.
_MEDIAN_OF_SQUARES = 0.4549364


@dataclass(frozen=True)
class ShapedNoise:
    """Noise of a kind that states its shape, with estimated sizes.

    Attributes
    ----------
    kind : Kind
    camera : str, where the camera of a board is
    factors : (G,) array, standard deviation of each group of errors, m or rad
    reference_m : float
        RMS standard deviation of a coordinate that is read, such as that of the board in
        the camera. The noise of a fit scales all factors by what it has instead.
    range_m : float or None
        Range at which the errors are as large as the factors; None for the median.
    """

    kind: Kind
    camera: str
    factors: np.ndarray
    reference_m: float = 1.0
    range_m: float | None = None

    def describe(self, observations: Observations) -> NoiseShape:
        """Describe the shape of the noise of observations."""
        assert observations.rotation is not None
        options = {"camera": self.camera, "range_m": self.range_m}
        shape = self.kind.shape_noise(
            observations.position, observations.rotation, options
        )
        assert shape is not None
        return shape

    def compute_roots(self, observations: Observations) -> np.ndarray:
        """Compute roots (M, r, r) of the covariances, in the axes of the session."""
        shape = self.describe(observations)
        return shape.axes * (shape.sizes * self.factors[shape.groups])[:, None]

    def refer(self, observations: Observations) -> ShapedNoise:
        """State the RMS standard deviation of a coordinate of what is read."""
        shape = self.describe(observations)
        deviations = (shape.sizes * self.factors[shape.groups])[:, :3]
        return replace(self, reference_m=float(np.sqrt((deviations**2).mean())))


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
    session = estimate.index_sessions(observations)
    into_base = estimate.frame_rotation[session].transpose(0, 2, 1)
    roots = model.shaped_noise.compute_roots(observations)
    scale = noise.position_m / model.shaped_noise.reference_m
    turned = [into_base @ roots[:, :3], into_base @ roots[:, 3:]]
    return scale * np.concatenate(turned, axis=1)


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
        factors.append(np.sqrt(np.median(squares) / _MEDIAN_OF_SQUARES))
    return replace(shaped, factors=np.array(factors)).refer(observations)
