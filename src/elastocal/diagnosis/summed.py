"""Sufficient statistics of measurements that are too many to be held whitened: one pass over blocks of whole poses.

Z'Sigma(tau)^-1 Z is summed at every size of the pose error that is likely, in memory that does not grow with the measurements.
The condition number of the declared part is not squared: candidates and residual come with what the declared parameters explain
of them in a sample of the measurements taken off, so that what is summed is of the size of what is left; the rest is exact
algebra.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from elastocal.fitting.observations import groups_by_size

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

# Beyond this many values of whitened columns a problem is summed: as many as take 60 MB, of which there are ten copies.
MOST_HELD = 8_000_000
# Rows of the sample: several for each declared parameter, and enough to see which sizes of the pose error are out of question.
SAMPLE_ROWS = 6000
# Values of whitened columns in a block.
_BLOCK_VALUES = 1_500_000


class InBasis(Protocol):
    """What tells the parameters of products: see `statistics.Products`."""

    @property
    def into_basis(self) -> np.ndarray:
        """ndarray (P, P)."""

    @property
    def projected(self) -> np.ndarray:
        """ndarray (P, K + 1)."""


@dataclass(frozen=True)
class WhiteRows:
    """Whitened rows of some whole poses, as the arguments of `statistics.products_of`; the poses number from 0 in each block.

    Attributes
    ----------
    declared : ndarray (R, P)
    candidates : ndarray (R, K)
    residual : ndarray (R,)
    jacobian : ndarray (R, n)
    pose : ndarray of int (R,)
    """

    declared: np.ndarray
    candidates: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray


@dataclass(frozen=True)
class Sums:
    """What `Products` are for measurements that are held; in the same parameters.

    Attributes
    ----------
    declared : int
        P.
    pose_error_rad : ndarray (T,)
        Zero first.
    totals : ndarray (T, P + K + 1, P + K + 1)
        Z'Sigma(tau)^-1 Z, the rows of the declared parameters' priors included.
    log_dets : ndarray (T,)
        ln |Sigma| beyond that of white noise.
    rows, freedom : int
    into_basis, projected : ndarray
        As in `Products`.
    """

    declared: int
    pose_error_rad: np.ndarray
    totals: np.ndarray
    log_dets: np.ndarray
    rows: int
    freedom: int
    into_basis: np.ndarray
    projected: np.ndarray

    @property
    def gram(self) -> np.ndarray:
        """Z'Z."""
        return self.totals[0]

    def alike(self, declared: np.ndarray, candidates: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """As `Products.alike`."""
        return rows_alike(self, declared, candidates, columns)


def rows_alike(products: InBasis, declared: np.ndarray, candidates: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """See `Products.alike`."""
    basis = declared @ products.into_basis
    return np.concatenate([basis, candidates - basis @ products.projected[:, columns]], axis=-1)


def rows_at_once(columns: int) -> int:
    """Rows of a block of so many columns."""
    return max(_BLOCK_VALUES // columns, 1)


def triangle_of(blocks: Iterable[np.ndarray]) -> np.ndarray:
    """Triangular factor of rows that come in blocks: sequential TSQR [1]_.

    Parameters
    ----------
    blocks : iterable of ndarray (R, k)
        One at least.

    Returns
    -------
    ndarray (k, k) or fewer rows

    References
    ----------
    .. [1] Demmel, J., Grigori, L., Hoemmen, M. and Langou, J., Communication-optimal parallel and sequential QR and LU
       factorizations, SIAM Journal on Scientific Computing 34, 2012.
    """
    rest = iter(blocks)
    triangle = _triangular_factor(next(rest))
    for block in rest:
        triangle = _triangular_factor(np.concatenate([triangle, block]))
    return triangle


def _triangular_factor(rows: np.ndarray) -> np.ndarray:
    return np.linalg.qr(rows, mode="r")  # type: ignore[return-value]  # numpy's stubs know of no mode that gives R alone


def summed(
    blocks: Iterable[WhiteRows],
    triangle: np.ndarray,
    sample: InBasis,
    prior_std: np.ndarray,
    present: np.ndarray,
    pose_error_rad: np.ndarray,
) -> Sums:
    """Sum the products of whitened rows.

    Parameters
    ----------
    blocks : iterable of WhiteRows
    triangle : ndarray (P, P)
        R of the declared columns of all rows.
    sample : Products
        Of a sample of them.
    prior_std, present : ndarray (P,)
        As in `statistics.products_of`.
    pose_error_rad : ndarray (T,)
        Zero first.

    Returns
    -------
    Sums
    """
    prior = np.diag(1.0 / prior_std)
    factor = _triangular_factor(np.concatenate([triangle, prior]))
    norms = np.linalg.norm(factor, axis=0)
    into_basis = np.linalg.inv(factor / norms) / norms[:, None]
    explained = sample.into_basis @ sample.projected
    count, width = len(prior), explained.shape[1] + len(prior)
    totals, log_dets = np.zeros((len(pose_error_rad), width, width)), np.zeros(len(pose_error_rad))
    rows = 0
    for block in blocks:
        every = np.empty((len(block.residual), width))
        np.matmul(block.declared, into_basis, out=every[:, :count])
        np.matmul(block.declared, -explained, out=every[:, count:])
        every[:, count:-1] += block.candidates
        every[:, -1] += block.residual
        rows += len(every)
        poses = groups_by_size(block.pose)
        for number, tau in enumerate(pose_error_rad):
            if not tau:
                totals[number] += every.T @ every
                continue
            for white, log_det in _whitened(every, block.jacobian, poses, tau):
                totals[number] += white.T @ white
                log_dets[number] += log_det
    rest = -prior @ explained
    rest[:, -1] -= present / prior_std
    every = np.concatenate([prior @ into_basis, rest], axis=1)
    totals += every.T @ every
    declared = totals[0, :count, :count]
    # Of the measurements, not of the priors: the trace of the hat matrix.
    hat = np.trace(np.linalg.solve(declared, declared - every[:, :count].T @ every[:, :count]))
    projected = np.linalg.solve(into_basis, explained)
    freedom = max(round(rows - hat), 1)
    return Sums(count, np.asarray(pose_error_rad), totals, log_dets, rows, freedom, into_basis, projected)


def _whitened(
    every: np.ndarray, jacobian: np.ndarray, poses: Iterable[np.ndarray], tau: float
) -> Iterator[tuple[np.ndarray, float]]:
    """Rows with (I + tau^2 J J')^-1/2 applied, and ln |I + tau^2 J J'|, for each number of rows in a pose."""
    for members in poses:
        seen = tau * jacobian[members]
        factor = np.linalg.cholesky(np.eye(members.shape[1]) + seen @ seen.transpose(0, 2, 1))
        white = np.linalg.inv(factor) @ every[members]
        yield white.reshape(-1, every.shape[1]), 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum()


def null_draws_of(sums: Sums, gram: np.ndarray, count: int, stream: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Statistics of simulated measurements of the declared model, at the size of the pose error with which they are simulated.

    b = W'My is normal with covariance G = W'MW, and y'My is its square in G^-1 and an independent chi-squared of what is left
    (Cochran's theorem [1]_).

    Parameters
    ----------
    sums : Sums
    gram : ndarray (K, K)
        W'MW.
    count : int
    stream : numpy.random.Generator

    Returns
    -------
    along : ndarray (K, N)
    squares : ndarray (N,)

    References
    ----------
    .. [1] Cochran, W. G., The distribution of quadratic forms in a normal system, with applications to the analysis of
       covariance, Proceedings of the Cambridge Philosophical Society 30, 1934.
    """
    scale = np.sqrt(np.clip(np.diag(gram), 1e-300, None))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > _ROUNDING * values[-1]
    white = stream.standard_normal((int(kept.sum()), count))
    along = scale[:, None] * (vectors[:, kept] @ (np.sqrt(values[kept])[:, None] * white))
    return along, (white**2).sum(axis=0) + stream.chisquare(max(sums.freedom - len(white), 1), count)


# Eigenvalues below this share of the largest are rounding.
_ROUNDING = 1e-9
