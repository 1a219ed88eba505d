"""A Gaussian process: smooth in all inputs, with intervals that grow away from the poses that were measured.

Its variance far from all of them is that of the residuals themselves, so that what it has not seen it calls unknown [1]. With
many observations it is projected onto its values at some of them (section 8.3.4 of [1]), which is exact where these are all.

[1] Rasmussen, C. E. and Williams, C. K. I., Gaussian Processes for Machine Learning, chapters 2, 4, 5 and 8, MIT Press, 2006.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import Bounds, minimize

from elastocal.remainder.protocol import Prediction

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from elastocal.remainder.protocol import Inputs, Predictor, Setting

NAME, WORDS = "gaussian_process", "Gaussian process"
# Marginal likelihood chooses among its hyperparameters, from the same poses.
SETTINGS: Sequence[Setting] = ({},)
# Hyperparameters come from so many observations: a step towards them costs the third power of their number, and 800 take eight
# times as long for errors that differ by 2 % either way (UR5 and UR10).
_MOST_FOR_HYPERPARAMETERS = 300
# Observations at which the process has values, drawn at random; their covariance takes 32 MB. Held-out RMS of UR10 A (8,350
# observations) after geometry: 0.169 mm with 1,000 in 0.5 s, 0.141 with 2,000 in 1.7 s, 0.122 with all in 14 s and 0.56 GB.
_MOST = 2_000
# Variance of the process, lengths in standard deviations of each input, from wiggles between neighbours to one trend across all
# poses, and variance of the noise: where the search starts, and its bounds.
_VARIANCE, _LENGTH, _NOISE = (1.0, 1e-3, 1e3), (1.0, 0.05, 100.0), (0.5, 1e-4, 10.0)
# By which share of the likelihood's logarithm the last steps of the search raise it: scipy's own 2e-9 stops on a plateau, whose
# way out changes of the residuals by 1e-8 decided (the simulated KUKA: a regression or none).
_LAST_GAIN = 1e-11
# Of the variance: added to the diagonal, so that rounding leaves it positive definite.
_JITTER = 1e-8
# An input that differs by less than this over all poses says nothing: rad, N, m, s, degC.
_STILL = 1e-10
# Predictions that are made at once.
_AT_ONCE = 500


def fitted(inputs: Inputs, residual: np.ndarray, settings: Sequence[Setting], seed: int) -> Iterator[Predictor]:
    """One process for all three axes, each with its own size: a Matérn kernel with a length for each input, and noise.

    `inputs`, `residual`, `settings`, `seed`: as in `protocol.Regression`. Yields with standard deviations.
    """
    draws, columns = np.random.default_rng(seed), inputs.columns
    taken = np.flatnonzero(columns.std(axis=0) > _STILL)
    middle, spread = columns[:, taken].mean(axis=0), columns[:, taken].std(axis=0)
    scaled = (columns[:, taken] - middle) / spread
    few, many = (np.sort(draws.permutation(len(scaled))[:most]) for most in (_MOST_FOR_HYPERPARAMETERS, _MOST))
    mean, size = residual.mean(axis=0), residual.std(axis=0)
    size = np.where(size > 0.0, size, 1.0)
    standard = (residual - mean) / size
    ranges = np.log([_VARIANCE, *[_LENGTH] * len(taken), _NOISE])
    # A length at its bound is an input without influence, not a failure.
    found = minimize(
        _surprise,
        ranges[:, 0],
        args=(scaled[few], standard[few]),
        method="L-BFGS-B",
        jac=True,
        bounds=Bounds(*ranges[:, 1:].T),
        options={"ftol": _LAST_GAIN},
    ).x
    variance, lengths, noise = _parted(found)
    places = scaled[many] / lengths
    lower = lapack.dpotrf(variance * (_matern(places, places)[0] + _JITTER * np.eye(len(many))), lower=1)[0]

    def features(inputs: np.ndarray) -> np.ndarray:
        return lapack.dtrtrs(lower, variance * _matern(places, inputs / lengths)[0], lower=1)[0]

    gram, right = noise * np.eye(len(many)), np.zeros((len(many), 3))
    for first in range(0, len(scaled), _AT_ONCE):
        known = features(scaled[first : first + _AT_ONCE])
        gram += known @ known.T
        right += known @ standard[first : first + _AT_ONCE]
    factor = lapack.dpotrf(gram, lower=1)[0]
    weights = variance * lapack.dtrtrs(lower, lapack.dpotrs(factor, right, lower=1)[0], lower=1, trans=1)[0] * size

    def predictor(there: Inputs) -> Prediction:
        asked = (there.columns[:, taken] - middle) / spread
        parts = [asked[first : first + _AT_ONCE] for first in range(0, len(asked), _AT_ONCE)]

        def std() -> np.ndarray:
            left = [np.zeros(0)]
            for part in parts:
                known = features(part)
                unsure = noise * (lapack.dtrtrs(factor, known, lower=1)[0] ** 2).sum(axis=0)
                left.append(variance + noise - (known**2).sum(axis=0) + unsure)
            return np.sqrt(np.maximum(np.concatenate(left), 0.0))[:, None] * size

        found = [np.zeros((0, 3)), *(_matern(part / lengths, places)[0] @ weights + mean for part in parts)]
        return Prediction(np.concatenate(found), std)

    yield from (predictor for _ in settings)


def _parted(logarithms: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Variance, lengths and variance of the noise."""
    values = np.exp(logarithms)
    return float(values[0]), values[1:-1], float(values[-1])


def _matern(some: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matérn's correlation of order 5/2, and the slope by which it falls with half of a squared distance: ndarray (N, M)."""
    square = (some**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2.0 * some @ others.T
    root = np.sqrt(np.maximum(5.0 * square, 0.0))
    slope = (1.0 + root) * np.exp(-root)
    return slope + root**2 / 3.0 * np.exp(-root), 5.0 / 3.0 * slope


def _surprise(logarithms: np.ndarray, inputs: np.ndarray, standard: np.ndarray) -> tuple[float, np.ndarray]:
    """Minus the logarithm of the marginal likelihood of all axes, and its gradient: equations 5.8 and 5.9 of [1].

    A length moves the covariance by a product of the slope and squared differences of one input, whose sum over all pairs is a
    product of matrices.

    `inputs` (N, k). `standard` (N, 3): residuals of mean 0 and size 1.
    """
    variance, lengths, noise = _parted(logarithms)
    (count, axes), scaled = standard.shape, inputs / lengths
    correlation, slope = _matern(scaled, scaled)
    covariance = variance * correlation
    covariance[np.diag_indices(count)] = variance + noise + _JITTER
    lower, failed = lapack.dpotrf(covariance.T, lower=1, overwrite_a=1)
    if failed:
        return np.inf, np.zeros(len(logarithms))
    along = lapack.dpotrs(lower, standard, lower=1)[0]
    value = 0.5 * (standard * along).sum() + axes * (np.log(np.diag(lower)).sum() + 0.5 * count * np.log(2.0 * np.pi))
    inverse = lapack.dpotri(lower, lower=1, overwrite_c=1)[0]
    # LAPACK leaves the other triangle as it was.
    inverse = np.tril(inverse)
    inverse += np.tril(inverse, -1).T
    inverse *= -axes
    inverse += along @ along.T
    of_noise, of_variance = noise * np.trace(inverse), variance * np.vdot(inverse.T, correlation)
    slope *= inverse
    of_lengths = 2.0 * variance * (slope.sum(axis=1) @ scaled**2 - (scaled * (slope @ scaled)).sum(axis=0))
    return float(value), -0.5 * np.array([of_variance, *of_lengths, of_noise])
