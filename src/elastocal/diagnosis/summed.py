"""Sufficient statistics of measurements that are too many to be held whitened: one pass over blocks of whole poses.

Z'Sigma(tau)^-1 Z is summed at every size of the pose error that is likely, in memory that does not grow with the measurements.
The condition number of the declared part is not squared: its columns come nearly orthonormal, by the triangular factor of all
of them. What they explain of candidates and residual is taken off the sums, as in `statistics.products_of`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elastocal.fitting.observations import groups_by_size

if TYPE_CHECKING:
    from collections.abc import Iterable

    from elastocal.fitting.factored import Factored

# Beyond this many values of whitened columns a problem is summed: as many as take 48 MB, of which there are ten copies. Of 5.2
# million (210 states) a diagnosis takes half the time held, of 6.6 (867 states) nine tenths summed.
MOST_HELD = 6_000_000
# Rows of the sample: several for each declared parameter, and enough to see which sizes of the pose error are out of question.
SAMPLE_ROWS = 3000
# Values of whitened columns in a block of declared ones, and observations in a block of candidates, which come in factors.
_BLOCK_VALUES = 1_500_000
OBSERVATIONS_AT_ONCE = 500


@dataclass(frozen=True)
class WhiteRows:
    """Whitened rows of M observations in some whole poses; states and poses number from 0 in each block.

    `declared` (M, rows, P): sensitivities to the declared parameters. `candidates`: sensitivities to the K columns of all
    candidates, in units of their plausible sizes. `residual` (M, rows). `jacobian` (M, rows, n): with respect to the joints.
    `pose` (M,) of int.
    """

    declared: np.ndarray
    candidates: Factored
    residual: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray

    @property
    def one_state_each(self) -> bool:
        """Whether every pose is one state: an error of the pose is one of the state then."""
        return len(np.unique(self.pose)) == len(np.unique(self.candidates.state))

    def products_by_pose(self, beside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What an error of the joints in each pose would look like in other rows, the candidates and itself.

        `beside` (M, rows, P + 1): orthonormal declared columns Q, and the residual y. Returns (G, n, P + K + 1): J'[Q W y] of
        each pose; (G, n, n): J'J.
        """
        count, joints, poses = beside.shape[2] - 1, self.jacobian.shape[2], int(self.pose.max()) + 1
        rows, gram = np.empty((poses, joints, count + self.candidates.columns + 1)), np.empty((poses, joints, joints))
        for members in groups_by_size(self.pose):
            mine, height = self.pose[members[:, 0]], members.shape[1] * beside.shape[1]
            turned = self.jacobian[members].reshape(len(members), height, joints).transpose(0, 2, 1)
            together = turned @ beside[members].reshape(len(members), height, count + 1)
            rows[mine, :, :count], rows[mine, :, -1] = together[..., :-1], together[..., -1]
            gram[mine] = turned @ turned.transpose(0, 2, 1)
        rows[..., count:-1] = self.candidates.times_by_pose(self.jacobian, self.pose)
        return rows, gram

    def whitened(self, tau: float) -> WhiteRows:
        """Rows with (I + tau^2 J J')^-1/2 applied, of poses that are one state each."""
        parts = self.declared, self.candidates.jacobian, self.residual[..., None], self.jacobian
        edges = np.cumsum([part.shape[2] for part in parts])[:-1]
        together = np.concatenate(parts, axis=2)
        white = np.empty(together.shape)
        for members in groups_by_size(self.pose):
            flat = together[members].reshape(*(len(members), -1), together.shape[2])
            seen = tau * flat[..., edges[-1] :]
            factor = np.linalg.cholesky(np.eye(seen.shape[1]) + seen @ seen.transpose(0, 2, 1))
            white[members] = np.linalg.solve(factor, flat).reshape(*members.shape, *together.shape[1:])
        declared, coordinates, residual, jacobian = np.split(white, edges, axis=2)
        return WhiteRows(declared, replace(self.candidates, jacobian=coordinates), residual[..., 0], jacobian, self.pose)


@dataclass(frozen=True)
class Sums:
    """What `Products` are for measurements that are held; in the same parameters.

    `declared`: P. `pose_error_rad` (T,): zero first. `totals` (T, P + K + 1, P + K + 1): Z'Sigma(tau)^-1 Z, the rows of the
    declared parameters' priors included. `log_dets` (T,): ln |Sigma| beyond that of white noise. `into_basis`, `projected`: as
    in `Products`.
    """

    declared: int
    pose_error_rad: np.ndarray
    totals: np.ndarray
    log_dets: np.ndarray
    freedom: int
    into_basis: np.ndarray
    projected: np.ndarray

    @property
    def gram(self) -> np.ndarray:
        """Z'Z."""
        return self.totals[0]


def rows_at_once(columns: int) -> int:
    """Rows of a block of so many columns."""
    return max(_BLOCK_VALUES // columns, 1)


def triangle_of(blocks: Iterable[np.ndarray]) -> np.ndarray:
    """Triangular factor of rows that come in blocks: sequential TSQR [1].

    `blocks` (R, k): one at least. Returns (k, k).

    [1] Demmel, J., Grigori, L., Hoemmen, M. and Langou, J., Communication-optimal parallel and sequential QR and LU
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
    blocks: Iterable[WhiteRows], triangle: np.ndarray, prior_std: np.ndarray, present: np.ndarray, pose_error_rad: np.ndarray
) -> Sums:
    """Sum the products of whitened rows.

    `blocks`: one at least, all of the same candidates. `triangle` (P, P): R of the declared columns of all rows. `prior_std`,
    `present` (P,): as in `statistics.products_of`. `pose_error_rad` (T,): zero first.
    """
    prior = np.diag(1.0 / prior_std)
    factor = _triangular_factor(np.concatenate([triangle, prior]))
    norms = np.linalg.norm(factor, axis=0)
    into_basis = np.linalg.inv(factor / norms) / norms[:, None]
    known, rows = np.concatenate([prior @ into_basis, (-present / prior_std)[:, None]], axis=1), 0
    sums = [_Sum() for _ in pose_error_rad]
    for block in blocks:
        rows += block.residual.size
        for tau, total in zip(pose_error_rad, sums, strict=True):
            total.add(block, into_basis, tau)
    count = len(prior)
    # Of the measurements, not of the priors: the trace of the hat matrix.
    measured = sums[0].beside
    hat = np.trace(np.linalg.solve((measured + known.T @ known)[:count, :count], measured[:count, :count]))
    log_dets = np.array([total.log_det for total in sums])
    totals = np.empty((0, 0, 0))
    for number in range(len(sums)):
        # What is summed for one size of the pose error makes room for the products of the next.
        raw = sums.pop(0).products(known.T @ known)
        if not number:
            totals = np.empty((len(log_dets), *raw.shape))
            projected = np.linalg.solve(raw[:count, :count], raw[:count, count:])
        rest = raw[:count, count:] - raw[:count, :count] @ projected
        twice = projected.T @ rest
        left = raw[count:, count:] - twice - twice.T - projected.T @ raw[:count, :count] @ projected
        if not number:
            inside = nothing_left(raw[count:-1, count:-1], left[:-1, :-1])
        rest[:, :-1][:, inside], left[:-1][inside], left[:, :-1][:, inside] = 0.0, 0.0, 0.0
        totals[number] = np.block([[raw[:count, :count], rest], [rest.T, left]])
    freedom = max(round(rows - hat), 1)
    return Sums(count, np.asarray(pose_error_rad), totals, log_dets, freedom, into_basis, projected)


class _Sum:
    """[Q W y]'Sigma(tau)^-1 [Q W y] at one size of the pose error, added up over blocks; Q are the orthonormal columns."""

    def __init__(self) -> None:
        self.beside: np.ndarray = np.zeros(())
        self.cross: np.ndarray = np.zeros(())
        self.entries: np.ndarray = np.zeros(())
        self.taken: np.ndarray = np.zeros(())
        self.log_det = 0.0
        self.candidates: Factored | None = None

    def add(self, block: WhiteRows, into_basis: np.ndarray, tau: float) -> None:
        """Add a block; where a pose is one state its error is whitened away, else taken off by Woodbury's identity."""
        if tau:
            self.log_det += _log_det(block, tau)
        one_state_each = bool(tau) and block.one_state_each
        if one_state_each:
            block = block.whitened(tau)
        beside = np.concatenate([block.declared @ into_basis, block.residual[..., None]], axis=2)
        flat = beside.reshape(-1, beside.shape[2])
        self.beside = self.beside + flat.T @ flat
        self.cross = self.cross + block.candidates.times(beside)
        self.entries = self.entries + block.candidates.gram_of_entries()
        self.candidates = block.candidates
        if tau and not one_state_each:
            rows, gram = block.products_by_pose(beside)
            factor = np.linalg.cholesky(np.eye(gram.shape[1]) + tau**2 * gram)
            taken = np.linalg.solve(factor, tau * rows).reshape(-1, rows.shape[2])
            self.taken = self.taken + taken.T @ taken

    def products(self, prior: np.ndarray) -> np.ndarray:
        """All of them, with those of the priors' rows [Q y] (P + 1, P + 1), ndarray (P + K + 1, P + K + 1)."""
        assert self.candidates is not None
        count = len(self.beside) - 1
        width = count + self.candidates.columns + 1
        at = np.append(np.arange(count), width - 1)
        found = np.empty((width, width))
        found[np.ix_(at, at)] = self.beside
        found[count:-1, count:-1] = self.candidates.folded_gram(self.entries)
        found[count:-1, at] = self.cross
        found[at, count:-1] = self.cross.T
        found -= self.taken
        found[np.ix_(at, at)] += prior
        return found


def _log_det(block: WhiteRows, tau: float) -> float:
    """ln |I + tau^2 J J'|."""
    total = 0.0
    for members in groups_by_size(block.pose):
        seen = tau * block.jacobian[members].reshape(len(members), -1, block.jacobian.shape[2])
        inner = np.eye(seen.shape[2]) + seen.transpose(0, 2, 1) @ seen
        total += float(np.linalg.slogdet(inner)[1].sum())
    return total


def nothing_left(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Columns of which nothing but rounding is left after something is taken off.

    `before`, `after` (K, K): products of the columns. Returns (K,) of bool.
    """
    return np.diag(after) <= _INSIDE * np.diag(before)


def null_draws_of(sums: Sums, gram: np.ndarray, count: int, stream: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Statistics of simulated measurements of the declared model, at the size of the pose error with which they are simulated.

    b = W'My is normal with covariance G = W'MW, and y'My is its square in G^-1 and an independent chi-squared of what is left
    (Cochran's theorem [1]).

    `gram` (K, K): W'MW. Returns `along` (K, N); `squares` (N,).

    [1] Cochran, W. G., The distribution of quadratic forms in a normal system, with applications to the analysis of covariance,
        Proceedings of the Cambridge Philosophical Society 30, 1934.
    """
    scale = np.sqrt(np.clip(np.diag(gram), 1e-300, None))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    kept = values > _ROUNDING * values[-1]
    white = stream.standard_normal((int(kept.sum()), count))
    along = scale[:, None] * (vectors[:, kept] @ (np.sqrt(values[kept])[:, None] * white))
    return along, (white**2).sum(axis=0) + stream.chisquare(max(sums.freedom - len(white), 1), count)


# Eigenvalues below this share of the largest are rounding; of a square from which another one was taken, this share.
_ROUNDING, _INSIDE = 1e-9, 1e-12
