"""Simulated statistics of a declared model in which nothing is missing: a parametric
bootstrap (Davison and Hinkley, Bootstrap Methods, 1997, 4.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from elastocal.diagnosis.statistics import get_elimination, project_on_axes

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
    white = stream.standard_normal((*products.rows.residual.shape, count))
    equations = _SimulatedEquations(products, white, np.asarray(pose_error_rad))
    joints = products.rows.jacobian.shape[2]
    for block in products.iterate_poses():
        noise = project_on_axes(
            block.rows.jacobian, block.rows.pose, white[block.selected]
        ).reshape(-1, count)
        if tau:
            # The joint errors of a pose are as independent along its principal axes as
            # they are joint by joint.
            poses, axes = block.eigenvalues.shape
            errors = stream.standard_normal((poses, joints, count))
            common = tau * errors[:, -axes:].reshape(noise.shape)
            equations.add_common_error(block, noise, common)
        equations.subtract_correction(block, noise)
    return equations.eliminate_declared(products)


class _SimulatedEquations:
    """Normal equations of N simulated data sets at T sizes of the pose error.

    Attributes
    ----------
    sizes : (T,), sizes of the pose error
    score : (P + K, N), products of all columns with the data, without a pose error
    residual_squares : (N,)
    score_corrections, square_corrections : (T, P + K, N), (T, N), to be subtracted for
        each size of the pose error
    """

    def __init__(
        self, products: CrossProducts, white: np.ndarray, sizes: np.ndarray
    ) -> None:
        self.sizes = sizes
        self.score = _project_on_columns(products, white)
        self.residual_squares = (white**2).sum(axis=(0, 1))
        self.score_corrections = np.zeros((len(sizes), *self.score.shape))
        self.square_corrections = np.zeros((len(sizes), white.shape[2]))

    def add_common_error(
        self, block: PoseBlock, noise: np.ndarray, common: np.ndarray
    ) -> None:
        """Add errors (G a, N) that the measurements of a pose have in common to the
        data, and to their products with the axes of the poses, `noise` (G a, N)."""
        eigenvalues = block.eigenvalues.reshape(-1, 1)
        squares = common * (2 * noise + eigenvalues * common)
        self.residual_squares += squares.sum(axis=0)
        self.score += _columns_by_axis(block).T @ common
        noise += eigenvalues * common

    def subtract_correction(self, block: PoseBlock, noise: np.ndarray) -> None:
        """Subtract the correction for the pose error of some poses, whose axes have the
        products `noise` (G a, N) with the data."""
        columns = _columns_by_axis(block)
        eigenvalues = block.eigenvalues.reshape(-1, 1)
        for number in np.flatnonzero(self.sizes).tolist():
            size = self.sizes[number]
            share = size**2 / (1.0 + size**2 * eigenvalues)
            solved = share * noise
            self.score_corrections[number] += columns.T @ solved
            self.square_corrections[number] += (noise * solved).sum(axis=0)

    def eliminate_declared(
        self, products: CrossProducts
    ) -> tuple[np.ndarray, np.ndarray]:
        """Marginalise the declared parameters: score (T, K, N), squares (T, N)."""
        declared = products.declared_count
        sizes, columns, count = self.score_corrections.shape
        score = np.empty((sizes, columns - declared, count))
        squares = self.residual_squares - self.square_corrections
        for number, size in enumerate(self.sizes.tolist()):
            corrected = self.score - self.score_corrections[number]
            elimination = get_elimination(products, size)
            fitted = solve_triangular(
                elimination.factor, corrected[:declared], lower=True
            )
            coupling = elimination.coupling[:, :-1]
            np.subtract(corrected[declared:], coupling.T @ fitted, out=score[number])
            squares[number] -= (fitted**2).sum(axis=0)
        return score, squares


def _columns_by_axis(block: PoseBlock) -> np.ndarray:
    """Products (G a, P + K) of the axes of the poses with all columns."""
    return block.products.reshape(-1, block.products.shape[2])[:, :-1]


def _project_on_columns(products: CrossProducts, white: np.ndarray) -> np.ndarray:
    """Products (P + K, N) of all columns with white noise (M, rows, N)."""
    basis = products.basis_and_residual[..., :-1]
    declared = np.tensordot(basis, white, ((0, 1), (0, 1)))
    candidates = products.rows.candidates.times(white)
    candidates = candidates - products.projections[:, :-1].T @ declared
    return np.concatenate([declared, candidates])
