"""Simulated statistics of a declared model in which nothing is missing: a parametric
bootstrap (Davison and Hinkley, Bootstrap Methods, 1997, 4.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from elastocal.fitting.observations import batch_groups_by_size

if TYPE_CHECKING:
    from elastocal.diagnosis.statistics import CrossProducts, PoseBlock


def simulate_null_statistics(
    products: CrossProducts,
    tau: float,
    pose_error_rad: np.ndarray,
    count: int,
    stream: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate measurements of unit variance by the declared model alone.

    Parameters
    ----------
    products : products of the whitened rows
    tau : pose error of the simulated measurements, rad
    pose_error_rad : (T,), sizes of the pose error at which to compute the statistics
    count : number N of simulated data sets
    stream : random numbers

    Returns
    -------
    score : (T, K, N), as in `SufficientStatistics`
    residual_squares : (T, N)
    """
    declared = products.declared_count
    sizes = np.asarray(pose_error_rad)
    white = stream.standard_normal((*products.rows.residual.shape, count))
    score = _project_on_columns(products, white)
    residual_squares = (white**2).sum(axis=(0, 1))
    declared_rows = np.tile(products.gram[:declared, :-1], (len(sizes), 1, 1))
    score_corrections = np.zeros((len(sizes), *score.shape))
    square_corrections = np.zeros((len(sizes), count))
    for block in products.iterate_poses():
        columns = block.products.reshape(-1, block.products.shape[2])[:, :-1]
        eigenvalues = block.eigenvalues.reshape(-1, 1)
        by_axis = _project_on_axes(block, white[block.selected])
        if tau:
            # The joint errors of a pose are as independent along its principal axes as
            # they are joint by joint.
            joints = products.rows.jacobian.shape[2]
            errors = stream.standard_normal((len(block.products), joints, count))
            axes = block.products.shape[1]
            common = tau * errors[:, -axes:].reshape(by_axis.shape)
            residual_squares += (common * (2 * by_axis + eigenvalues * common)).sum(
                axis=0
            )
            score += columns.T @ common
            by_axis += eigenvalues * common
        for number in np.flatnonzero(sizes).tolist():
            size = sizes[number]
            share = size**2 / (1.0 + size**2 * eigenvalues)
            solved = share * by_axis
            score_corrections[number] += columns.T @ solved
            square_corrections[number] += (by_axis * solved).sum(axis=0)
            declared_rows[number] -= columns[:, :declared].T @ (share * columns)
    return _eliminate_declared(
        declared_rows,
        score,
        score_corrections,
        residual_squares - square_corrections,
    )


def _project_on_columns(products: CrossProducts, white: np.ndarray) -> np.ndarray:
    """Products (P + K, N) of all columns with white noise (M, rows, N)."""
    basis = products.basis_and_residual[..., :-1]
    declared = np.tensordot(basis, white, ((0, 1), (0, 1)))
    candidates = products.rows.candidates.times(white)
    candidates = candidates - products.projections[:, :-1].T @ declared
    return np.concatenate([declared, candidates])


def _project_on_axes(block: PoseBlock, white: np.ndarray) -> np.ndarray:
    """Products (G a, N) of the Jacobian along the principal axes of each pose with
    white noise (M, rows, N)."""
    poses, axes = block.eigenvalues.shape
    count = white.shape[2]
    by_pose = np.empty((poses, axes, count))
    for members in batch_groups_by_size(block.rows.pose):
        jacobian = block.rows.jacobian[members].reshape(len(members), -1, axes)
        noise = white[members].reshape(len(members), -1, count)
        by_pose[block.rows.pose[members[:, 0]]] = jacobian.transpose(0, 2, 1) @ noise
    return by_pose.reshape(-1, count)


def _eliminate_declared(
    declared_rows: np.ndarray,
    score: np.ndarray,
    score_corrections: np.ndarray,
    residual_squares: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Marginalise the declared parameters at each size of the pose error.

    Parameters
    ----------
    declared_rows : (T, P, P + K), rows of the Gram matrix of the declared parameters
    score : (P + K, N), without a pose error
    score_corrections : (T, P + K, N), to be subtracted for each size of it
    residual_squares : (T, N)

    Returns
    -------
    (T, K, N) and (T, N), as of `simulate_null_statistics`
    """
    declared = declared_rows.shape[1]
    sizes, columns, count = score_corrections.shape
    marginal_score = np.empty((sizes, columns - declared, count))
    marginal_squares = residual_squares.copy()
    for number, rows in enumerate(declared_rows):
        corrected = score - score_corrections[number]
        factor = np.linalg.cholesky(rows[:, :declared])
        fitted = solve_triangular(factor, corrected[:declared], lower=True)
        cross = solve_triangular(factor, rows[:, declared:], lower=True)
        np.subtract(corrected[declared:], cross.T @ fitted, out=marginal_score[number])
        marginal_squares[number] -= (fitted**2).sum(axis=0)
    return marginal_score, marginal_squares
