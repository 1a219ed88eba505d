"""Sufficient statistics of a linearised model: all that the measurements say of it, in
arrays whose size does not grow with the number of measurements.

The measurements are y = X beta + W gamma + e, where X holds the sensitivities of the
declared model and W those of all candidates, both whitened by the measurement noise.
The measurements of a pose may also have an error in common: the joint errors when the
pose was taken, of covariance tau^2 I, seen through the Jacobian J_p of the pose. By the
matrix inversion lemma (Hager, SIAM Review 1989)

    Z' Sigma(tau)^-1 Z = Z'Z - sum over poses B_p' (I / tau^2 + C_p)^-1 B_p,
    B_p = J_p' Z_p,   C_p = J_p' J_p,   Z = [X W y],

so that one pass over the poses serves every tau. Candidate columns are first made
orthogonal to X by a QR decomposition of the scaled rows, so that the condition number
of X is not squared. Marginalising beta gives W'MW, W'My and y'My with M = Sigma^-1 -
Sigma^-1 X (X'Sigma^-1 X)^-1 X'Sigma^-1, and the determinants of restricted maximum
likelihood (REML; Harville, JASA 1977).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import blas, solve_triangular

from elastocal.fitting.observations import batch_groups_by_size

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.fitting.linearization import FactoredSensitivities

# Upper bound on the products of poses with all columns that are in memory at once: 8 MB.
_AT_ONCE = 1_000_000
# Rows of a matrix that are copied at once.
_STRIP = 256
# A column is spanned by the declared ones if less than this share of its square is
# left: that is rounding.
_INSIDE = 1e-12
# If there are more columns than this many times the rows of the low-rank correction for
# the pose error, the correction is stored in factors. Below this ratio a dense Gram
# matrix for each size of the pose error is cheaper.
_COLUMNS_A_ROW = 4


@dataclass(frozen=True)
class WhitenedRows:
    """Whitened rows of M observations in some whole poses.

    Attributes
    ----------
    declared : (M, rows, P) sensitivities to the declared parameters
    candidates : sensitivities to the K columns of all candidates, in units of their
        plausible sizes
    residual : (M, rows)
    jacobian : (M, rows, n) derivatives with respect to the joint angles
    pose : (M,) int, number of the pose of each observation, from 0
    """

    declared: np.ndarray
    candidates: FactoredSensitivities
    residual: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray

    def at(self, selected: np.ndarray) -> WhitenedRows:
        """Select whole poses by a (M,) bool array, and number them anew."""
        if selected.all():
            return self
        pose = np.unique(self.pose[selected], return_inverse=True)[1]
        return WhitenedRows(
            self.declared[selected],
            self.candidates.at(selected),
            self.residual[selected],
            self.jacobian[selected],
            pose,
        )


@dataclass(frozen=True)
class PoseBlock:
    """Products of the Jacobian with all columns, for G whole poses.

    Attributes
    ----------
    selected : (M,) bool, which of all observations are of these poses
    rows : their whitened rows; its Jacobian is along the principal axes of each pose
    products : (G, a, P + K + 1), B_p along a principal axes of C_p
    eigenvalues : (G, a), of C_p
    """

    selected: np.ndarray
    rows: WhitenedRows
    products: np.ndarray
    eigenvalues: np.ndarray


@dataclass(frozen=True)
class Elimination:
    """Normal equations at one size of the pose error, after the P declared parameters
    have been eliminated by Cholesky's method.

    Attributes
    ----------
    factor : (P, P) lower Cholesky factor of the block of the declared parameters
    coupling : (P, K + 1), the factor's inverse times the block that couples them with
        the candidate columns and the residual
    gram : (K + 1, K + 1), products of the latter
    low_rank : (K + 1, R), to be squared and subtracted from `gram`
    """

    factor: np.ndarray
    coupling: np.ndarray
    gram: np.ndarray
    low_rank: np.ndarray


@dataclass(frozen=True)
class CrossProducts:
    """Products of all columns, from which statistics follow at any size of the pose
    error, those of simulated measurements too.

    Attributes
    ----------
    rows : the whitened rows
    basis_and_residual : (M, rows, P + 1), the declared columns made orthonormal, and
        the residual
    declared_count : P
    gram : (P + K + 1, P + K + 1), Z'Z of Z = [X W y] with the rows of the priors
    degrees_of_freedom : measured numbers less those that the declared model fits
    basis_transform : (P, P), turns declared columns into orthonormal ones
    projections : (P, K + 1), coordinates of the other columns in the orthonormal ones
    spanned : (K,) bool, candidate columns of which the declared ones leave nothing
    elimination_cache : eliminations by the size of the pose error, so that normal
        equations at a size that was met need no second pass over the poses, nor the
        rows themselves; `compute_statistics` fills it
    """

    rows: WhitenedRows
    basis_and_residual: np.ndarray
    declared_count: int
    gram: np.ndarray
    degrees_of_freedom: int
    basis_transform: np.ndarray
    projections: np.ndarray
    spanned: np.ndarray
    elimination_cache: dict[float, Elimination] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def without_candidates(self) -> CrossProducts:
        """The products of the declared model alone."""
        kept = np.append(np.arange(self.declared_count), -1)
        no_columns = np.zeros(len(self.spanned), bool)
        return replace(
            self,
            rows=replace(
                self.rows, candidates=self.rows.candidates.select_columns(no_columns)
            ),
            gram=self.gram[np.ix_(kept, kept)],
            projections=self.projections[:, -1:],
            spanned=self.spanned[:0],
            elimination_cache={},
        )

    @property
    def without_rows(self) -> CrossProducts:
        """The same without the arrays that grow with the measurements.

        Normal equations are then available only at sizes of the pose error that are in
        the cache.
        """
        no_rows = np.zeros(len(self.basis_and_residual), bool)
        return replace(
            self,
            rows=self.rows.at(no_rows),
            basis_and_residual=self.basis_and_residual[:0],
        )

    @property
    def axes(self) -> int:
        """Number of principal axes of each pose: the number of joints, or that of the
        numbers measured in any pose if these are fewer."""
        components = self.rows.jacobian.shape[1]
        most_observations = int(np.bincount(self.rows.pose).max())
        return min(self.rows.jacobian.shape[2], most_observations * components)

    def iterate_poses(self) -> Iterator[PoseBlock]:
        """Yield the products of poses with all columns, some poses at a time."""
        poses = int(self.rows.pose.max()) + 1
        step = max(_AT_ONCE // (self.gram.shape[0] * self.axes), 1)
        for start in range(0, poses, step):
            selected = (self.rows.pose >= start) & (self.rows.pose < start + step)
            basis_and_residual = self.basis_and_residual
            if poses > step:
                basis_and_residual = basis_and_residual[selected]
            count = min(step, poses - start)
            yield self._pose_block(selected, basis_and_residual, count)

    def _pose_block(
        self, selected: np.ndarray, basis_and_residual: np.ndarray, poses: int
    ) -> PoseBlock:
        rows = self.rows.at(selected)
        declared = self.declared_count
        axes = self.axes
        jacobian = np.empty((*rows.jacobian.shape[:2], axes))
        products = np.empty((poses, axes, self.gram.shape[0]))
        eigenvalues = np.empty((poses, axes))
        for members in batch_groups_by_size(rows.pose):
            pose = rows.pose[members[:, 0]]
            by_joint = rows.jacobian[members].reshape(
                len(members), -1, rows.jacobian.shape[2]
            )
            values, vectors = np.linalg.eigh(by_joint.transpose(0, 2, 1) @ by_joint)
            eigenvalues[pose] = values[:, -axes:]
            by_axis = by_joint @ vectors[..., -axes:]
            jacobian[members] = by_axis.reshape(*members.shape, *jacobian.shape[1:])
        dense = project_on_axes(jacobian, rows.pose, basis_and_residual)
        products[..., :declared] = dense[..., :-1]
        products[..., -1] = dense[..., -1]
        products[..., declared:-1] = rows.candidates.multiply_by_pose(
            jacobian, rows.pose
        )
        flat_products = products.reshape(-1, products.shape[2])
        flat_products[:, declared:] -= flat_products[:, :declared] @ self.projections
        products[..., declared:-1][..., self.spanned] = 0.0
        return PoseBlock(
            selected,
            replace(rows, jacobian=jacobian),
            products,
            np.maximum(eigenvalues, 0.0),
        )


def project_on_axes(
    jacobian: np.ndarray, pose: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Multiply the Jacobian (M, rows, a) along the principal axes of each pose with
    some values (M, rows, N): products (G, a, N) of the poses."""
    axes = jacobian.shape[2]
    products = np.empty((pose.max() + 1, axes, values.shape[2]))
    for members in batch_groups_by_size(pose):
        by_axis = jacobian[members].reshape(len(members), -1, axes)
        by_pose = values[members].reshape(len(members), -1, values.shape[2])
        products[pose[members[:, 0]]] = by_axis.transpose(0, 2, 1) @ by_pose
    return products


def compute_cross_products(
    rows: WhitenedRows, prior_std: np.ndarray, present: np.ndarray
) -> CrossProducts:
    """Compute the products of whitened rows.

    The declared columns are made orthonormal by QR of the scaled rows, so that no
    condition number is squared. The candidates' share in them is subtracted from their
    products by Pythagoras' theorem. That costs 1e-16 of the square of a candidate,
    which is nothing compared with noise of one. The number of parameters that the
    declared model fits is its effective degrees of freedom, the trace of its hat matrix
    (Hastie and Tibshirani, Generalized Additive Models, 1990).

    Parameters
    ----------
    rows : whitened rows
    prior_std : (P,), standard deviation of the prior of each declared parameter; wide
        priors keep the problem well posed
    present : (P,), present value of each declared parameter less its prior mean
    """
    declared_count = rows.declared.shape[2]
    declared = rows.declared.reshape(rows.residual.size, declared_count)
    augmented = np.concatenate([declared, np.diag(1.0 / prior_std)])
    norms = np.linalg.norm(augmented, axis=0)
    basis, triangle = np.linalg.qr(augmented / norms)
    measured_basis = basis[: len(declared)]
    residual = np.concatenate([rows.residual.ravel(), -present / prior_std])
    basis_and_residual = np.concatenate(
        [measured_basis, rows.residual.reshape(-1, 1)], axis=1
    ).reshape(*rows.residual.shape, declared_count + 1)
    products = rows.candidates.times(basis_and_residual)
    projections = np.concatenate(
        [products[:, :-1].T, (basis.T @ residual)[:, None]], axis=1
    )
    gram = np.eye(projections.shape[1] + declared_count)
    spanned = _fill_candidate_products(
        gram[declared_count:, declared_count:],
        rows.candidates.gram(),
        products[:, -1],
        projections,
    )
    residual -= basis @ projections[:, -1]
    # A second projection removes the rounding of the first.
    residual -= basis @ (basis.T @ residual)
    gram[-1, -1] = residual @ residual
    return CrossProducts(
        rows,
        basis_and_residual,
        declared_count,
        gram,
        degrees_of_freedom=max(round(len(declared) - (measured_basis**2).sum()), 1),
        basis_transform=np.linalg.inv(triangle) / norms[:, None],
        projections=projections,
        spanned=spanned,
    )


def _fill_candidate_products(
    gram: np.ndarray,
    candidate_gram: np.ndarray,
    candidate_residual: np.ndarray,
    projections: np.ndarray,
) -> np.ndarray:
    """Write the products of the candidates, orthogonal to the declared columns, into
    `gram` (K + 1, K + 1), and return which columns are spanned by those (K,)."""
    shares = projections[:, :-1]
    orthogonal = gram[:-1, :-1]
    score = candidate_residual - shares.T @ projections[:, -1]
    np.subtract(candidate_gram, shares.T @ shares, out=orthogonal)
    spanned = np.diag(orthogonal) <= _INSIDE * np.diag(candidate_gram)
    orthogonal[spanned] = 0.0
    orthogonal[:, spanned] = 0.0
    score[spanned] = 0.0
    gram[:-1, -1] = score
    gram[-1, :-1] = score
    return spanned


@dataclass(frozen=True)
class SufficientStatistics:
    """Sufficient statistics at T sizes of the pose error, for K candidate columns.

    Attributes
    ----------
    pose_error_rad : (T,), tau
    gram : (T, K, K) or (1, K, K)
    low_rank : (T, K, R); W'MW is `gram` less the product of `low_rank` with its
        transpose. If the poses are few, `gram` is that without a pose error and serves
        all tau; if they are many, R is 0.
    score : (T, K), W'My, the gradient of the log likelihood where no candidate acts
    residual_squares : (T,), y'My
    log_likelihood : (T,), what tau contributes by itself, -1/2 ln |Sigma| -
        1/2 ln |X'Sigma^-1 X|
    degrees_of_freedom : rows less those that the declared model fits
    """

    pose_error_rad: np.ndarray
    gram: np.ndarray
    low_rank: np.ndarray
    score: np.ndarray
    residual_squares: np.ndarray
    log_likelihood: np.ndarray
    degrees_of_freedom: int

    def at(self, chosen: np.ndarray | slice) -> SufficientStatistics:
        """Select sizes of the pose error; consecutive ones are views, not copies."""
        if not isinstance(chosen, slice):
            chosen = np.asarray(chosen)
            if len(chosen) and np.ptp(chosen) == len(chosen) - 1:
                chosen = slice(int(chosen[0]), int(chosen[-1]) + 1)
        # One Gram matrix may serve all sizes.
        shared_gram = len(self.gram) != len(self.residual_squares)
        return SufficientStatistics(
            self.pose_error_rad[chosen],
            self.gram if shared_gram else self.gram[chosen],
            self.low_rank[chosen],
            self.score[chosen],
            self.residual_squares[chosen],
            self.log_likelihood[chosen],
            self.degrees_of_freedom,
        )

    def nearest(self, pose_error_rad: float) -> int:
        """Index of the size of the pose error that is nearest to a given one."""
        return int(np.argmin(np.abs(self.pose_error_rad - pose_error_rad)))

    def gram_rows(self, columns: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Products (T, D, A) of some columns (D,) of W'MW with others (A,)."""
        gram = self.gram[:, columns[:, None], others]
        if not self.low_rank.shape[2]:
            return gram
        low_rank = self.low_rank[:, columns]
        return gram - low_rank @ self.low_rank[:, others].swapaxes(-1, -2)

    def gram_blocks(self, columns: np.ndarray) -> np.ndarray:
        """Blocks (T, ..., D, D) of W'MW of some columns (..., D)."""
        gram = self.gram[:, columns[..., None], columns[..., None, :]]
        if not self.low_rank.shape[2]:
            return gram
        low_rank = self.low_rank[:, columns]
        return gram - low_rank @ low_rank.swapaxes(-1, -2)


class _PoseErrorEquations:
    """Normal equations at T sizes of the pose error, from which the correction for the
    pose error is subtracted one block of poses after the other.

    The rows of the declared parameters are dense. The block of the K candidates and the
    residual is dense for each size, or shared by all with the correction in factors.
    """

    def __init__(self, products: CrossProducts, sizes: np.ndarray) -> None:
        declared = products.declared_count
        columns = len(products.gram) - declared
        correction_rows = (int(products.rows.pose.max()) + 1) * products.axes + declared
        self.sizes = sizes
        self.declared_count = declared
        self.is_factored = correction_rows * _COLUMNS_A_ROW < columns
        # Without a pose error the declared columns are orthonormal, and orthogonal to
        # all others.
        self.declared_rows = np.tile(products.gram[:declared], (len(sizes), 1, 1))
        self.gram = products.gram[None, declared:, declared:]
        if not self.is_factored:
            self.gram = np.tile(self.gram, (len(sizes), 1, 1))
        rank = correction_rows if self.is_factored else 0
        self.low_rank = np.zeros((len(sizes), columns, rank))
        self.log_dets = np.zeros(len(sizes))
        self._first_row = 0

    def _subtract_square(self, number: int, rows: np.ndarray) -> None:
        """Subtract the product of some rows (r, K + 1) with themselves; of a dense
        matrix only below its diagonal, see `eliminate_declared`."""
        if self.is_factored:
            chosen = slice(self._first_row, self._first_row + len(rows))
            self.low_rank[number, :, chosen] = rows.T
        else:
            # BLAS adds the product where it is computed. The transposes have the
            # column order that it expects, so that nothing is copied.
            blas.dsyrk(
                -1.0,
                rows.T,
                beta=1.0,
                c=self.gram[number].T,
                overwrite_c=1,
            )

    def subtract_correction(self, block: PoseBlock) -> None:
        """Subtract the correction for the pose error of some poses."""
        declared = self.declared_count
        products = block.products.reshape(-1, block.products.shape[2])
        for number in np.flatnonzero(self.sizes).tolist():
            tau = self.sizes[number]
            widened = 1.0 + tau**2 * block.eigenvalues
            factor = (tau / np.sqrt(widened)).reshape(-1, 1)
            of_declared = factor * products[:, :declared]
            of_others = factor * products[:, declared:]
            declared_rows = self.declared_rows[number]
            declared_rows[:, :declared] -= of_declared.T @ of_declared
            declared_rows[:, declared:] -= of_declared.T @ of_others
            self._subtract_square(number, of_others)
            self.log_dets[number] += np.log1p(tau**2 * block.eigenvalues).sum()
        self._first_row += block.eigenvalues.size

    def eliminate_declared(self) -> list[Elimination]:
        """Eliminate the declared parameters at each size of the pose error."""
        declared = self.declared_count
        factors = np.linalg.cholesky(self.declared_rows[:, :, :declared])
        eliminations = []
        for number, tau in enumerate(self.sizes):
            coupling = self.declared_rows[number, :, declared:]
            if tau:
                coupling = solve_triangular(factors[number], coupling, lower=True)
                self._subtract_square(number, coupling)
                if not self.is_factored:
                    _copy_below_diagonal(self.gram[number])
            eliminations.append(
                Elimination(
                    factors[number],
                    coupling,
                    self.gram[0 if self.is_factored else number],
                    self.low_rank[number],
                )
            )
        return eliminations


def _copy_below_diagonal(matrix: np.ndarray) -> None:
    """Make a square matrix symmetric by what stands below its diagonal, in place."""
    for start in range(0, len(matrix), _STRIP):
        strip = slice(start, start + _STRIP)
        corner = np.tril(matrix[strip, strip])
        matrix[strip, strip] = corner + np.tril(corner, -1).T
        matrix[strip, strip.stop :] = matrix[strip.stop :, strip].T


def compute_statistics(
    products: CrossProducts, pose_error_rad: np.ndarray
) -> SufficientStatistics:
    """Compute the sufficient statistics at some sizes of the pose error (T,)."""
    sizes = np.asarray(pose_error_rad)
    equations = _PoseErrorEquations(products, sizes)
    if sizes.any():
        for block in products.iterate_poses():
            equations.subtract_correction(block)
    eliminations = equations.eliminate_declared()
    for tau, elimination in zip(sizes, eliminations, strict=True):
        products.elimination_cache[float(tau)] = elimination
    factors = np.array([elimination.factor for elimination in eliminations])
    log_factors = np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    gram = equations.gram
    low_rank = equations.low_rank
    last_row = gram[:, -1] - (low_rank @ low_rank[:, -1, :, None])[..., 0]
    return SufficientStatistics(
        sizes,
        gram[:, :-1, :-1],
        low_rank[:, :-1],
        score=last_row[:, :-1],
        residual_squares=last_row[:, -1],
        log_likelihood=-0.5 * equations.log_dets - log_factors,
        degrees_of_freedom=products.degrees_of_freedom,
    )


def get_elimination(products: CrossProducts, tau: float) -> Elimination:
    """Return the elimination of the declared parameters at one size of the pose error,
    from the cache if that size was met."""
    if tau not in products.elimination_cache:
        compute_statistics(products, np.array([tau]))
    return products.elimination_cache[tau]


def assemble_normal_equations(
    products: CrossProducts, tau: float, columns: np.ndarray
) -> np.ndarray:
    """Assemble Z'Sigma(tau)^-1 Z of the declared columns, some candidate columns (D,)
    and the residual, (P + D + 1, P + D + 1)."""
    elimination = get_elimination(products, tau)
    chosen = np.append(columns, -1)
    factor = elimination.factor
    coupling = elimination.coupling[:, chosen]
    low_rank = elimination.low_rank[chosen]
    across = factor @ coupling
    candidates = elimination.gram[np.ix_(chosen, chosen)]
    candidates = candidates - low_rank @ low_rank.T + coupling.T @ coupling
    return np.block([[factor @ factor.T, across], [across.T, candidates]])
