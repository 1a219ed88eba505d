"""Observations that all candidates together do not explain.

Before it is known which effects the declared model lacks, observations are predicted by
all that it may lack at once. An observation that is far from this prediction is a gross
error whichever model is chosen later.

All numbers of the observations have a joint normal distribution, so that distances from
the prediction by other observations follow from its inverse covariance in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from elastocal.diagnosis.evidence import SizeGrid
from elastocal.diagnosis.gross_errors import compute_critical_distance, flag_outliers

if TYPE_CHECKING:
    from elastocal.diagnosis.candidate_design import CandidateDesign
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.statistics import CrossProducts


def find_unexplained_observations(design: CandidateDesign) -> np.ndarray:
    """Find the observations that all candidates together do not explain.

    The worst observation is deleted until the others agree with each other. Then
    deleted observations come back if the others predict them after all: several gross
    errors may have hidden good observations.

    Returns
    -------
    ndarray
        (M,) of bool.
    """
    settings = design.settings
    precision = _compute_precision(design)
    kept, reduced = _delete_worst(precision, settings)
    if kept.all():
        return ~kept
    precision = _add_pose_error(
        precision, reduced, design.products, design.candidate_pose_errors_rad
    )
    return ~_readmit_predicted(precision, kept, settings)


@dataclass(frozen=True)
class _Precision:
    """Inverse covariance I - F F' of the n numbers of M observations with c components.

    What is added to the covariance, or an observation that is deleted, adds columns to
    F, by Woodbury's identity. Rows and columns of deleted observations are zero.

    Attributes
    ----------
    factors
        Blocks of columns of F, each (n, q).
    blocks
        (M, c, c), the diagonal block of each observation.
    residual
        (n,).
    weighted_residual
        (n,), the inverse covariance times the residual.
    """

    factors: tuple[np.ndarray, ...]
    blocks: np.ndarray
    residual: np.ndarray
    weighted_residual: np.ndarray

    @classmethod
    def identity(cls, residual: np.ndarray) -> _Precision:
        """The inverse covariance of white noise, of residuals (M, c)."""
        count, components = residual.shape
        blocks = np.tile(np.eye(components), (count, 1, 1))
        return cls((), blocks, residual.ravel(), residual.ravel())

    def subtract(self, columns: np.ndarray, inner: np.ndarray) -> _Precision:
        """Subtract C A^-1 C', with `columns` C, (n, q), and `inner` A, (q, q)."""
        factor = solve_triangular(np.linalg.cholesky(inner), columns.T, lower=True).T
        by_observation = factor.reshape(*self.blocks.shape[:2], -1)
        change = factor @ (factor.T @ self.residual)
        return replace(
            self,
            factors=(*self.factors, factor),
            blocks=self.blocks - by_observation @ by_observation.swapaxes(1, 2),
            weighted_residual=self.weighted_residual - change,
        )

    def select_columns(self, indices: np.ndarray) -> np.ndarray:
        """Some columns of the inverse covariance, (n, q)."""
        columns = -sum(factor @ factor[indices].T for factor in self.factors)
        columns[indices, np.arange(len(indices))] += 1.0
        return columns

    def delete(self, indices: np.ndarray) -> _Precision:
        """The inverse covariance of the numbers without some: a Schur complement."""
        columns = self.select_columns(indices)
        return self.subtract(columns, columns[indices])

    def multiply(self, matrix: np.ndarray) -> np.ndarray:
        """The inverse covariance times a matrix (n, q)."""
        return matrix - sum(factor @ (factor.T @ matrix) for factor in self.factors)

    def compute_distances(self, kept: np.ndarray) -> np.ndarray:
        """Lengths of the deletion residuals of observations that are kept, (M,), and
        zeros for those that are deleted."""
        blocks = np.where(
            kept[:, None, None], self.blocks, np.eye(self.blocks.shape[1])
        )
        residual = self.weighted_residual.reshape(*self.blocks.shape[:2], 1)
        squares = (residual * np.linalg.solve(blocks, residual)).sum(axis=(1, 2))
        return np.where(kept, np.sqrt(np.maximum(squares, 0.0)), 0.0)


def _compute_precision(design: CandidateDesign) -> _Precision:
    """Inverse covariance of the whitened residuals under all candidates at once.

    The covariance is I + X D X' + W S W', with X the sensitivities to the declared
    parameters, D their priors, W the sensitivities to all candidates and S their mean
    square size over the grid.
    """
    products = design.products
    rows = products.rows
    declared = products.declared_count
    grid = SizeGrid.from_settings(design.settings)
    size = np.sqrt(np.exp(grid.log_weights) @ grid.scales**2)
    basis = products.basis_and_residual[..., :-1].reshape(rows.residual.size, -1)
    candidates = rows.candidates.dense().reshape(rows.residual.size, -1)
    candidates -= basis @ products.projections[:, :-1]
    gram = products.gram[declared:-1, declared:-1]
    precision = _Precision.identity(rows.residual).subtract(basis, np.eye(declared))
    return precision.subtract(
        size * candidates, np.eye(candidates.shape[1]) + size**2 * gram
    )


def _delete_worst(
    precision: _Precision, settings: Settings
) -> tuple[np.ndarray, _Precision]:
    """Delete the observation farthest from its prediction by the others until none is
    beyond the critical distance, or too many are deleted.

    Returns
    -------
    ndarray, _Precision
        Observations that are kept, (M,) of bool, and their inverse covariance.
    """
    count, components = precision.blocks.shape[:2]
    limit = compute_critical_distance(count, components, settings)
    kept = np.ones(count, bool)
    while kept.mean() > 1.0 - settings.gross_error_share:
        distance = precision.compute_distances(kept)
        worst = int(np.argmax(distance))
        if distance[worst] <= limit:
            break
        kept[worst] = False
        first = worst * components
        precision = precision.delete(np.arange(first, first + components))
    return kept, precision


def _readmit_predicted(
    precision: _Precision, kept: np.ndarray, settings: Settings
) -> np.ndarray:
    """Take deleted observations back until the others predict none of those that stay
    deleted. Returns the observations that are kept, (M,) of bool."""
    components = precision.blocks.shape[1]
    while not kept.all():
        distance = _compute_distances_from_kept(precision, kept)
        _, outlier = flag_outliers(distance, components, kept, settings)
        predicted = ~kept & ~outlier
        if not predicted.any():
            break
        kept = kept | predicted
    return kept


def _compute_distances_from_kept(precision: _Precision, kept: np.ndarray) -> np.ndarray:
    """Distances from the prediction by the observations that are kept, (M,): deletion
    residuals of these, and conditional normal distributions of the others."""
    components = precision.blocks.shape[1]
    deleted = np.flatnonzero(np.repeat(~kept, components))
    distance = precision.delete(deleted).compute_distances(kept)
    covariance = np.linalg.inv(precision.select_columns(deleted)[deleted])
    deviation = (covariance @ precision.weighted_residual[deleted]).reshape(
        -1, components, 1
    )
    count = len(deviation)
    by_observation = covariance.reshape(count, components, count, components)
    blocks = by_observation[np.arange(count), :, np.arange(count)]
    squares = (deviation * np.linalg.solve(blocks, deviation)).sum(axis=(1, 2))
    distance[~kept] = np.sqrt(squares)
    return distance


def _add_pose_error(
    precision: _Precision,
    reduced: _Precision,
    products: CrossProducts,
    pose_errors_rad: np.ndarray,
) -> _Precision:
    """Add the joint error that the observations of a pose have in common.

    Its size is the one of `pose_errors_rad`, (T,), that makes the observations that are
    kept most probable. `reduced`: inverse covariance of these alone.
    """
    jacobian = _build_pose_jacobian(products)
    weighted = precision.multiply(jacobian)
    deleted_factors = reduced.factors[len(precision.factors) :]
    reduced_weighted = weighted - sum(
        factor @ (factor.T @ jacobian) for factor in deleted_factors
    )
    information = jacobian.T @ reduced_weighted
    gradient = jacobian.T @ reduced.weighted_residual
    identity = np.eye(jacobian.shape[1])

    def log_likelihood(size: float) -> float:
        root = np.linalg.cholesky(identity + size**2 * information)
        fall = 0.5 * (size * solve_triangular(root, gradient, lower=True)) ** 2
        return float(fall.sum() - np.log(np.diag(root)).sum())

    ranked = [(log_likelihood(size), size) for size in pose_errors_rad.tolist()]
    size = max(ranked)[1]
    inner = identity + size**2 * jacobian.T @ weighted
    return precision.subtract(size * weighted, inner)


def _build_pose_jacobian(products: CrossProducts) -> np.ndarray:
    """Jacobian with respect to the joint errors of all poses along their principal
    axes, (n, poses * axes)."""
    rows = products.rows
    poses = int(rows.pose.max()) + 1
    jacobian = np.zeros((*rows.residual.shape, poses, products.axes))
    for block in products.iterate_poses():
        selected = np.flatnonzero(block.selected)
        jacobian[selected, :, rows.pose[selected]] = block.rows.jacobian
    return jacobian.reshape(rows.residual.size, -1)
