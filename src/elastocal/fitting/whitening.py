"""Generalized least squares: residuals and sensitivities divided by the noise of the states in which they were taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.noise import measurement_covariances

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations


@dataclass(frozen=True)
class Whitening:
    """What turns correlated rows into independent ones of unit variance.

    Attributes
    ----------
    blocks : tuple of (ndarray (G, k), ndarray (G, k * rows, k * rows))
        For the states, or the poses, with k observations: their indices, and the inverse Cholesky factor of their covariance.
    """

    blocks: tuple[tuple[np.ndarray, np.ndarray], ...]

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Whitened values.

        Parameters
        ----------
        values : ndarray (M, rows, ...)

        Returns
        -------
        ndarray (M, rows, ...)
        """
        whitened = np.empty_like(values)
        tail = values.shape[2:]
        for members, factor in self.blocks:
            stacked = values[members].reshape(*factor.shape[:2], -1)
            whitened[members] = (factor @ stacked).reshape(*members.shape, values.shape[1], *tail)
        return whitened


def whitening(observations: Observations, jacobian: np.ndarray | None, noise: Noise) -> Whitening:
    """Whitening of averaged observations.

    For generalized least squares [1]_: inverse Cholesky factors of the covariance of what errs together.

    Parameters
    ----------
    observations : Observations
    jacobian : ndarray (M, rows, n)
        With respect to the joints.
    noise : Noise
        Of one measurement.

    Returns
    -------
    Whitening

    References
    ----------
    .. [1] Aitken, A. C., On least squares and linear combination of observations, Proceedings of the Royal Society of Edinburgh
       55, 1935.
    """
    if not noise.pose_rad and not noise.joint_rad.any():
        return Whitening(tuple(_of_sensor_alone(observations, noise)))
    # Where joints err, it takes a Jacobian to see it.
    assert jacobian is not None
    blocks = [(m, np.linalg.inv(np.linalg.cholesky(c))) for m, c in _covariances(observations, jacobian, noise)]
    return Whitening(tuple(blocks))


def _of_sensor_alone(observations: Observations, noise: Noise) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Blocks where nothing is correlated: one factor for all that are averages of as many repeats, held once."""
    precision = np.diag(1.0 / np.repeat([noise.position_m, noise.orientation_rad], 3)[: observations.rows])
    repeats = observations.states.repeats[observations.state]
    for number in np.unique(repeats):
        members = np.flatnonzero(repeats == number)[:, None]
        yield members, np.broadcast_to(np.sqrt(number) * precision, (len(members), *precision.shape))


def _covariances(observations: Observations, jacobian: np.ndarray, noise: Noise) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Observations with correlated errors (G, k) and their covariance (G, k * rows, k * rows), for each number k.

    Those of a state share the approach; where poses have an error in common, those of all states of a pose share it.
    """
    rows, repeats = observations.rows, observations.states.repeats[observations.state]
    if not noise.pose_rad:
        for members in _members(observations.state):
            covariance = measurement_covariances(noise, jacobian[members], rows)
            yield members, covariance / repeats[members[:, 0]][:, None, None]
        return
    for members in _members(observations.cluster):
        stacked = jacobian[members].reshape(len(members), members.shape[1] * rows, -1)
        state = np.repeat(observations.state[members], rows, axis=1)
        alike = (state[:, :, None] == state[:, None, :]) / np.repeat(repeats[members], rows, axis=1)[:, None, :]
        common = noise.pose_rad**2 * (stacked @ stacked.transpose(0, 2, 1))
        yield members, alike * measurement_covariances(noise, jacobian[members], rows) + common


def _members(group: np.ndarray) -> list[np.ndarray]:
    """Observations of each state or pose, for each number of them in one: arrays (G, k)."""
    seen = np.bincount(group)
    start = np.concatenate([[0], np.cumsum(seen)[:-1]])
    return [start[seen == count][:, None] + np.arange(count) for count in np.unique(seen[seen > 0])]
