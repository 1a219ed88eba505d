"""Observations that all candidates together do not explain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from elastocal.diagnosis.candidate_design import CandidateDesign
from elastocal.diagnosis.evidence import SizeGrid
from elastocal.diagnosis.gross_errors import compute_critical_distance, flag_outliers

if TYPE_CHECKING:
    from elastocal.diagnosis.statistics import CrossProducts


def find_unexplained_observations(line: CandidateDesign) -> np.ndarray:
    """Which observations all candidates together do not explain, ndarray of bool (M,).

    The whitened residual has the covariance I + X D X' + W S W', with X the declared
    sensitivities, D their priors, W those of all candidates, S their mean square size.
    The worst are taken out until what is left agrees; then those that it predicts come
    back.
    """
    products = line.products
    settings = line.settings
    rows = products.rows
    count = products.declared_count
    observed, own = rows.residual.shape
    grid = SizeGrid.from_settings(settings)
    kept = np.ones(observed, bool)
    residual = rows.residual.ravel()
    size = np.sqrt(np.exp(grid.log_weights) @ grid.scales**2)
    limit = compute_critical_distance(observed, own, settings)
    basis, candidates = (
        part.reshape(len(residual), -1)
        for part in (products.basis_and_residual[..., :-1], rows.candidates.dense())
    )
    candidates -= basis @ products.projections[:, :-1]
    whole = _Precision(
        (), np.tile(np.eye(own), (observed, 1, 1)), residual, residual
    ).less(basis, np.eye(count))
    whole = whole.less(
        size * candidates,
        np.eye(candidates.shape[1]) + size**2 * products.gram[count:-1, count:-1],
    )
    some = whole
    while kept.mean() > 1.0 - settings.gross_error_share:
        distance = some.distances(kept)
        worst = int(np.argmax(distance))
        if distance[worst] <= limit:
            break
        kept[worst] = False
        some = some.without(np.arange(worst * own, (worst + 1) * own))
    if not kept.all():
        whole = _with_pose_error(whole, some, products, line.candidate_pose_errors_rad)
    while not kept.all():
        out = np.flatnonzero(np.repeat(~kept, own))
        some = whole.without(out)
        distance = some.distances(kept)
        variance = np.linalg.inv(whole.between(out)[out])
        rest = (variance @ whole.along[out]).reshape(-1, own, 1)
        blocks = variance.reshape(len(rest), own, len(rest), own)[
            np.arange(len(rest)), :, np.arange(len(rest))
        ]
        distance[~kept] = np.sqrt(
            (rest * np.linalg.solve(blocks, rest)).sum(axis=(1, 2))
        )
        back = ~kept & ~flag_outliers(distance, own, kept, settings)[1]
        if not back.any():
            break
        kept |= back
    return ~kept


@dataclass(frozen=True)
class _Precision:
    """Inverse covariance I - F F' of the n numbers of M observations: what is added to
    a covariance, or is taken out of the observations, adds some columns to F
    (Woodbury's identity).

    `factors` (n, ...): F, some columns after the other. `blocks` (M, own, own): on the
    diagonal, of each observation. `residual`, `along` (n,): what the inverse is times
    the residual. Zero of observations that are taken out.
    """

    factors: tuple[np.ndarray, ...]
    blocks: np.ndarray
    residual: np.ndarray
    along: np.ndarray

    def less(self, left: np.ndarray, inner: np.ndarray) -> _Precision:
        """This less left inner^-1 left', `left` (n, q), `inner` (q, q)."""
        factor = solve_triangular(np.linalg.cholesky(inner), left.T, lower=True).T
        each = factor.reshape(*self.blocks.shape[:2], -1)
        blocks = self.blocks - each @ each.swapaxes(1, 2)
        along = self.along - factor @ (factor.T @ self.residual)
        return replace(
            self, factors=(*self.factors, factor), blocks=blocks, along=along
        )

    def between(self, some: np.ndarray) -> np.ndarray:
        """Some columns, ndarray (n, q)."""
        found = -sum(factor @ factor[some].T for factor in self.factors)
        found[some, np.arange(len(some))] += 1.0
        return found

    def without(self, out: np.ndarray) -> _Precision:
        """Of the numbers without some."""
        columns = self.between(out)
        return self.less(columns, columns[out])

    def distances(self, kept: np.ndarray) -> np.ndarray:
        """Length of the deletion residual of each observation that is kept, 0 of
        others, (M,)."""
        blocks = np.where(
            kept[:, None, None], self.blocks, np.eye(self.blocks.shape[1])
        )
        along = self.along.reshape(*self.blocks.shape[:2], 1)
        squares = (along * np.linalg.solve(blocks, along)).sum(axis=(1, 2))
        return np.where(kept, np.sqrt(np.maximum(squares, 0.0)), 0.0)


def _with_pose_error(
    whole: _Precision,
    some: _Precision,
    products: CrossProducts,
    pose_errors_rad: np.ndarray,
) -> _Precision:
    """The inverse covariance with an error common to a pose, of the size that makes
    some of the numbers most probable.

    `some`: the same without those that are taken out.
    """
    rows = products.rows
    jacobian = np.zeros((*rows.residual.shape, int(rows.pose.max()) + 1, products.axes))
    for block in products.iterate_poses():
        observations = np.flatnonzero(block.selected)
        jacobian[observations, :, rows.pose[observations]] = block.rows.jacobian
    jacobian = jacobian.reshape(len(whole.residual), -1)
    of_whole = jacobian - sum(
        factor @ (factor.T @ jacobian) for factor in whole.factors
    )
    of_some = of_whole - sum(
        factor @ (factor.T @ jacobian) for factor in some.factors[len(whole.factors) :]
    )
    inner = jacobian.T @ of_some
    along = jacobian.T @ some.along
    unit = np.eye(jacobian.shape[1])
    best = (-np.inf, 0.0)
    for tau in pose_errors_rad.tolist():
        root = np.linalg.cholesky(unit + tau**2 * inner)
        gained = 0.5 * (tau * solve_triangular(root, along, lower=True)) ** 2
        best = max(best, (float(gained.sum() - np.log(np.diag(root)).sum()), tau))
    return whole.less(best[1] * of_whole, unit + best[1] ** 2 * jacobian.T @ of_whole)
