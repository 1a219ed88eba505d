"""Generalized least squares: residuals and sensitivities divided by the noise of the states in which they were taken."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.noise import measurement_covariances, of_components
from elastocal.fitting.observations import groups_by_size

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations


@dataclass(frozen=True)
class Whitening:
    """What turns correlated rows into independent ones of unit variance.

    `blocks` (ndarray (G, k), ndarray (G, k * rows, k * rows)): for the states, or the poses, with k observations: their
    indices, and the inverse Cholesky factor of their covariance.
    """

    blocks: tuple[tuple[np.ndarray, np.ndarray], ...]

    def apply(self, values: np.ndarray) -> np.ndarray:
        """Whitened values.

        `values` (M, rows, ...). Returns (M, rows, ...).
        """
        (members, factor), *others = self.blocks
        if not others and (members.ravel() == np.arange(len(values))).all():
            # One after the other: nothing to gather.
            return (factor @ values.reshape(*factor.shape[:2], -1)).reshape(values.shape)
        whitened = np.empty(values.shape)
        for members, factor in self.blocks:
            stacked = values[members].reshape(*factor.shape[:2], -1)
            whitened[members] = (factor @ stacked).reshape(*members.shape, *values.shape[1:])
        return whitened

    def after(self, maps: np.ndarray) -> Whitening:
        """What whitens values to each of whose observations a matrix is applied first.

        `maps` (M, rows, rows).
        """
        blocks = []
        for members, factor in self.blocks:
            groups, count = members.shape
            by_member = factor.reshape(groups, -1, count, maps.shape[1]).swapaxes(1, 2)
            blocks.append((members, (by_member @ maps[members]).swapaxes(1, 2).reshape(factor.shape)))
        return Whitening(tuple(blocks))


@dataclass(frozen=True)
class Scaling:
    """What turns rows into ones of unit variance where nothing is correlated.

    `precision` (rows,): of one measurement: one over its standard deviation. `root` (M,), (M, rows): square root of the number
    of measurements of which each observation is the average, over their spread.
    """

    precision: np.ndarray
    root: np.ndarray

    def apply(self, values: np.ndarray) -> np.ndarray:
        """As `Whitening.apply`."""
        scale = self._scale()
        return values * scale.reshape(*scale.shape, *[1] * (values.ndim - 2))

    def after(self, maps: np.ndarray) -> Whitening:
        """As `Whitening.after`."""
        return Whitening(((np.arange(len(maps))[:, None], self._scale()[:, :, None] * maps),))

    def _scale(self) -> np.ndarray:
        return self.root.reshape(len(self.root), -1) * self.precision


def joined(parts: Sequence[Whitening | Scaling], starts: Sequence[int]) -> Whitening | Scaling:
    """Whitening of observations of which there is one for each part.

    `starts`: the first observation of each.
    """
    scalings = [part for part in parts if isinstance(part, Scaling)]
    if scalings:
        return Scaling(scalings[0].precision, np.concatenate([part.root for part in scalings]))
    correlated = [part for part in parts if isinstance(part, Whitening)]
    pairs = zip(correlated, starts, strict=True)
    return Whitening(tuple((members + start, factor) for part, start in pairs for members, factor in part.blocks))


def whitening(observations: Observations, jacobian: np.ndarray | None, noise: Noise) -> Whitening | Scaling:
    """Whitening of averaged observations.

    For generalized least squares [1]: inverse Cholesky factors of the covariance of what errs together.

    `jacobian` (M, rows, n): with respect to the joints. `noise`: of one measurement.

    [1] Aitken, A. C., On least squares and linear combination of observations, Proceedings of the Royal Society of Edinburgh
        55, 1935.
    """
    spread = noise.spread(observations)
    if not noise.pose_rad and not noise.joint_rad.any():
        precision = 1.0 / np.repeat([noise.position_m, noise.orientation_rad], 3)[: observations.rows]
        root = np.sqrt(observations.states.repeats[observations.state])
        return Scaling(precision, root if spread is None else root[:, None] / of_components(spread, observations.rows))
    # Where joints err, it takes a Jacobian to see it.
    assert jacobian is not None
    blocks = [(m, np.linalg.inv(np.linalg.cholesky(c))) for m, c in _covariances(observations, jacobian, noise, spread)]
    return Whitening(tuple(blocks))


def _covariances(
    observations: Observations, jacobian: np.ndarray, noise: Noise, spread: np.ndarray | None
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Observations with correlated errors (G, k) and their covariance (G, k * rows, k * rows), for each number k.

    Those of a state share the approach; where poses have an error in common, those of all states of a pose share it.
    """
    rows, repeats = observations.rows, observations.states.repeats[observations.state]
    if not noise.pose_rad:
        for members in groups_by_size(observations.state):
            each = None if spread is None else spread[members]
            covariance = measurement_covariances(noise, jacobian[members], rows, each)
            yield members, covariance / repeats[members[:, 0]][:, None, None]
        return
    for members in groups_by_size(observations.cluster):
        stacked = jacobian[members].reshape(len(members), members.shape[1] * rows, -1)
        state = np.repeat(observations.state[members], rows, axis=1)
        alike = (state[:, :, None] == state[:, None, :]) / np.repeat(repeats[members], rows, axis=1)[:, None, :]
        common = noise.pose_rad**2 * (stacked @ stacked.transpose(0, 2, 1))
        each = None if spread is None else spread[members]
        yield members, alike * measurement_covariances(noise, jacobian[members], rows, each) + common
