"""Generalized least squares: residuals and sensitivities divided by the noise of the states in which they were taken."""

from dataclasses import dataclass

import numpy as np

from elastocal.noise import reading_covariances


@dataclass(frozen=True)
class Whitening:
    """What turns correlated rows into independent ones of unit variance.

    Attributes
    ----------
    blocks : tuple of (ndarray (G, k), ndarray (G, k * rows, k * rows))
        For the states, or the poses, with k observations: their indices, and the inverse Cholesky factor of their covariance.
    """

    blocks: tuple

    def apply(self, values):
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


def whitening(observations, jacobian, noise, discrepancy_m=0.0):
    """Whitening of averaged observations.

    Parameters
    ----------
    observations : Observations
    jacobian : ndarray (M, rows, n)
        With respect to the joints.
    noise : Noise
        Of one reading.
    discrepancy_m : float
        Standard deviation, in positions, of what the model lacks and repeats do not average out; orientations get the share
        that they have of the noise.

    Returns
    -------
    Whitening
    """
    blocks = []
    lacking = _lacking(noise, observations.rows) * discrepancy_m**2
    for members, covariance in _covariances(observations, jacobian, noise):
        diagonal = np.arange(covariance.shape[1])
        covariance[:, diagonal, diagonal] += np.tile(lacking, members.shape[1])
        blocks.append((members, np.linalg.inv(np.linalg.cholesky(covariance))))
    return Whitening(tuple(blocks))


def spectrum(observations, jacobian, noise, values):
    """Values in the directions in which a discrepancy of the model only adds to the variance.

    Parameters
    ----------
    observations, jacobian, noise
        As in `whitening`.
    values : ndarray (M, rows)

    Returns
    -------
    variances, squares : ndarray (M * rows,)
        With a discrepancy d the squared length of the whitened values is the sum of squares / (variances + d^2).
    """
    variances, squares = [], []
    for members, covariance in _covariances(observations, jacobian, noise):
        scale = np.tile(1.0 / np.sqrt(_lacking(noise, observations.rows)), members.shape[1])
        found, vectors = np.linalg.eigh(covariance * scale[:, None] * scale)
        turned = vectors.transpose(0, 2, 1) @ (values[members].reshape(len(members), -1) * scale)[..., None]
        variances.append(found.ravel())
        squares.append(turned.ravel() ** 2)
    return np.concatenate(variances), np.concatenate(squares)


def _covariances(observations, jacobian, noise):
    """Observations with correlated errors (G, k) and their covariance (G, k * rows, k * rows), for each number k.

    Those of a state share the approach; where poses have an error in common, those of all states of a pose share it.
    """
    rows, repeats = observations.rows, observations.states.repeats[observations.state]
    if not noise.pose_rad:
        for members in _members(observations.state):
            covariance = reading_covariances(noise, jacobian[members], rows)
            yield members, covariance / repeats[members[:, 0]][:, None, None]
        return
    for members in _members(observations.cluster):
        stacked = jacobian[members].reshape(len(members), members.shape[1] * rows, -1)
        state = np.repeat(observations.state[members], rows, axis=1)
        alike = (state[:, :, None] == state[:, None, :]) / np.repeat(repeats[members], rows, axis=1)[:, None, :]
        common = noise.pose_rad**2 * (stacked @ stacked.transpose(0, 2, 1))
        yield members, alike * reading_covariances(noise, jacobian[members], rows) + common


def _lacking(noise, rows):
    """Variance of each component for a discrepancy of one in positions."""
    return np.repeat([1.0, noise.orientation_rad / noise.position_m], 3)[:rows] ** 2


def _members(group):
    """Observations of each state or pose, for each number of them in one: arrays (G, k)."""
    seen = np.bincount(group)
    start = np.concatenate([[0], np.cumsum(seen)[:-1]])
    return [start[seen == count][:, None] + np.arange(count) for count in np.unique(seen[seen > 0])]
