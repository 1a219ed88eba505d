"""All that the measurements say of a linearised model, in numbers whose count does not grow with the measurements.

Measurements y = X beta + W gamma + e, with X the declared model's sensitivities and W those of all candidates, both whitened by
the noise of the measurements. The measurements of a pose may have an error in common as well: that of the joints when the pose
was taken, of variance Lambda(tau) = tau^2 I (+ Sigma_q where one approach serves a whole pose), seen through the Jacobian. By
the matrix inversion lemma (Woodbury's identity [1])

    Z' Sigma(tau)^-1 Z = Z'Z - sum over poses B_p' (Lambda^-1 + C_p)^-1 B_p,   B_p = J_p' Z_p,   C_p = J_p' J_p,   Z = [X W y],

so that one pass over the measurements serves every tau. Columns are first made orthogonal to X by a QR decomposition of the
scaled rows: the condition number of X is not squared. Marginalising beta gives W'MW, W'My, y'My with M = Sigma^-1 - Sigma^-1 X
(X'Sigma^-1 X)^-1 X'Sigma^-1 and the determinants of restricted maximum likelihood (REML [2]).

[1] Hager, W. W., Updating the inverse of a matrix, SIAM Review 31, 1989.
[2] Harville, D. A., Maximum likelihood approaches to variance component estimation and to related problems, Journal of the
    American Statistical Association 72, 1977.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_triangular

from elastocal.diagnosis.summed import Sums, nothing_left, null_draws_of
from elastocal.fitting.observations import groups_by_size

if TYPE_CHECKING:
    from elastocal.diagnosis.summed import WhiteRows


@dataclass(frozen=True)
class Statistics:
    """Sufficient statistics at T sizes of the pose error, for K columns.

    `pose_error_rad` (T,): tau. `gram` (T, K, K): W'MW. `along` (T, K): W'My. `squares` (T,): y'My. `log_likelihood` (T,): what
    tau contributes alone: -1/2 ln |Sigma| - 1/2 ln |X'Sigma^-1 X|. `freedom`: rows less what the declared model fits.
    """

    pose_error_rad: np.ndarray
    gram: np.ndarray
    along: np.ndarray
    squares: np.ndarray
    log_likelihood: np.ndarray
    freedom: int

    def at(self, chosen: np.ndarray | slice) -> Statistics:
        """The same at some of the sizes of the pose error only; a slice copies nothing."""
        some = {name: values[chosen] for name, values in vars(self).items() if name != "freedom"}
        return Statistics(**some, freedom=self.freedom)

    def nearest(self, pose_error_rad: float) -> int:
        """Place of the size of the pose error that is nearest to one."""
        return int(np.argmin(np.abs(self.pose_error_rad - pose_error_rad)))


@dataclass(frozen=True)
class Products:
    """What one pass over the measurements gathers; `statistics_of` makes `Statistics` of it, `null_draws` simulated ones.

    `declared`: P, columns of the declared model; orthonormal. `gram` (P + K + 1, P + K + 1): Z'Z of Z = [X W y]. `pose_rows`
    (G, n, P + K + 1): B_p of each of G poses. `pose_gram` (G, n, n): C_p. `joint_rad` (n,): repeatability of the joints, where
    the measurements of a pose share one approach; else zero. `rows`: of which they are. `freedom`: measurements' components
    less what the declared model fits. `into_basis` (P, P): turns declared columns into orthonormal ones. `projected` (P, K +
    1): what the orthonormal columns have in those of the candidates and the residual.
    """

    declared: int
    gram: np.ndarray
    pose_rows: np.ndarray
    pose_gram: np.ndarray
    joint_rad: np.ndarray
    rows: WhiteRows
    freedom: int
    into_basis: np.ndarray
    projected: np.ndarray

    @property
    def without_candidates(self) -> Products:
        """Of the declared model alone."""
        kept = np.append(np.arange(self.declared), self.gram.shape[0] - 1)
        return replace(
            self, gram=self.gram[np.ix_(kept, kept)], pose_rows=self.pose_rows[..., kept], projected=self.projected[:, -1:]
        )


def rows_alike(products: Products | Sums, declared: np.ndarray, candidates: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Whitened rows at other states in the parameters of some products.

    `declared` (..., P). `candidates` (..., U): sensitivities to some of the candidates, in units of their plausible sizes.
    `columns` (U,) of int: which of them. Returns (..., P + U).
    """
    basis = declared @ products.into_basis
    return np.concatenate([basis, candidates - basis @ products.projected[:, columns]], axis=-1)


def products_of(rows: WhiteRows, prior_std: np.ndarray, present: np.ndarray, joint_rad: np.ndarray) -> Products:
    """Gather the products of whitened rows.

    `prior_std` (P,): standard deviation of the prior of each declared parameter; wide ones keep the problem well posed.
    `present` (P,): present value of each less the mean of its prior. `joint_rad` (n,): as in `Products`.

    The declared columns are made orthonormal by QR of the scaled rows, so that no condition number is squared; what candidates
    have in them is taken off their products by Pythagoras' theorem, which costs 1e-16 of the square of a candidate: nothing
    beside noise of one. What the declared model fits are its effective degrees of freedom, the trace of its hat matrix [1].

    [1] Hastie, T. J. and Tibshirani, R. J., Generalized Additive Models, Chapman and Hall, 1990.
    """
    observed, components, count = rows.declared.shape
    declared = rows.declared.reshape(observed * components, count)
    scaled = np.concatenate([declared, np.diag(1.0 / prior_std)])
    norms = np.linalg.norm(scaled, axis=0)
    basis, triangle = np.linalg.qr(scaled / norms)
    seen = basis[: len(declared)]
    residual = np.concatenate([rows.residual.ravel(), -present / prior_std])
    beside = np.concatenate([seen, rows.residual.reshape(-1, 1)], axis=1).reshape(observed, components, count + 1)
    products = rows.candidates.times(beside)
    projected = np.concatenate([products[:, :-1].T, (basis.T @ residual)[:, None]], axis=1)
    left = residual - basis @ projected[:, -1]
    left -= basis @ (basis.T @ left)
    width = projected.shape[1] + count
    gram, squares = np.eye(width), rows.candidates.gram()
    own, along = gram[count:-1, count:-1], products[:, -1] - projected[:, :-1].T @ projected[:, -1]
    np.subtract(squares, projected[:, :-1].T @ projected[:, :-1], out=own)
    inside = nothing_left(squares, own)
    own[inside], own[:, inside], along[inside] = 0.0, 0.0, 0.0
    gram[count:-1, -1] = gram[-1, count:-1] = along
    gram[-1, -1] = left @ left
    pose_rows, pose_gram = rows.products_by_pose(beside)
    pose_rows[..., count:] -= pose_rows[..., :count] @ projected
    pose_rows[..., count:-1][..., inside] = 0.0
    freedom = max(round(len(declared) - (seen**2).sum()), 1)
    into_basis = np.linalg.inv(triangle) / norms[:, None]
    return Products(count, gram, pose_rows, pose_gram, joint_rad, rows, freedom, into_basis, projected)


def statistics_of(products: Products | Sums, pose_error_rad: np.ndarray) -> Statistics:
    """Sufficient statistics at some sizes of the pose error.

    `pose_error_rad` (T,).
    """
    declared = products.declared
    count = products.gram.shape[0] - declared
    rest, logs = np.empty((len(pose_error_rad), count, count)), np.empty(len(pose_error_rad))
    for number, tau in enumerate(pose_error_rad):
        if isinstance(products, Sums):
            total, log_det = normal_equations(products, tau)
            known, rows = total[:declared], np.zeros((0, len(total)))
        else:
            total = products.gram
            rows, log_det = _pose_factor(products, tau)
            known = total[:declared] - rows[:, :declared].T @ rows
        factor = np.linalg.cholesky(known[:, :declared])
        # The Schur complement of the declared columns, and what the pose error takes, at once.
        taken = np.concatenate([rows[:, declared:], solve_triangular(factor, known[:, declared:], lower=True)])
        np.matmul(taken.T, taken, out=rest[number])
        np.subtract(total[declared:, declared:], rest[number], out=rest[number])
        logs[number] = -0.5 * log_det - np.log(np.diag(factor)).sum()
    return Statistics(np.asarray(pose_error_rad), rest[:, :-1, :-1], rest[:, :-1, -1], rest[:, -1, -1], logs, products.freedom)


def normal_equations(products: Products | Sums, tau: float) -> tuple[np.ndarray, float]:
    """Z'Sigma(tau)^-1 Z, and ln |Sigma| beyond that of white noise.

    `tau`: rad; of sums, the nearest of their sizes counts. Returns (P + K + 1, P + K + 1).
    """
    if isinstance(products, Sums):
        place = int(np.argmin(np.abs(products.pose_error_rad - tau)))
        return products.totals[place], products.log_dets[place]
    rows, log_det = _pose_factor(products, tau)
    return (products.gram - rows.T @ rows if len(rows) else products.gram), log_det


def null_draws(
    products: Products | Sums, tau: float, pose_error_rad: np.ndarray, count: int, stream: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Statistics of simulated measurements of the declared model, in which nothing is missing.

    A parametric bootstrap [1]; of sums, which have no measurements any more, of the statistics themselves.

    `tau`: pose error with which to simulate, rad. `pose_error_rad` (T,): at which the statistics are wanted; of sums, that with
    which they are simulated alone. Returns `along` (T, K, N); `squares` (T, N): as in `Statistics`, for N draws of unit
    variance.

    [1] Davison, A. C. and Hinkley, D. V., Bootstrap Methods and their Application, section 4.2, Cambridge University Press,
        1997.
    """
    if isinstance(products, Sums):
        gram = statistics_of(products, np.array([tau])).gram[0]
        along, squares = null_draws_of(products, gram, count, stream)
        return along[None], squares[None]
    rows, (poses, joints, width) = products.rows, products.pose_rows.shape
    flat = products.pose_rows.reshape(poses * joints, width)[:, :-1]
    white = stream.standard_normal((*rows.residual.shape, count))
    fitted = np.tensordot(rows.declared @ products.into_basis, white, ((0, 1), (0, 1)))
    along = np.concatenate([fitted, rows.candidates.times(white) - products.projected[:, :-1].T @ fitted])
    seen = np.empty((poses, joints, count))
    for members in groups_by_size(rows.pose):
        turned = rows.jacobian[members].reshape(len(members), -1, joints).transpose(0, 2, 1)
        seen[rows.pose[members[:, 0]]] = turned @ white[members].reshape(len(members), -1, count)
    squares = (white**2).sum(axis=(0, 1))
    deviation = _joint_deviations(products, tau)
    if deviation.any():
        common = deviation[:, None] * stream.standard_normal((poses, joints, count))
        moved = products.pose_gram @ common
        squares += (common * (2 * seen + moved)).sum(axis=(0, 1))
        along += flat.T @ common.reshape(-1, count)
        seen += moved
    found_along = np.empty((len(pose_error_rad), flat.shape[1] - products.declared, count))
    found_squares = np.empty((len(pose_error_rad), count))
    for number, size_rad in enumerate(pose_error_rad):
        these, left = along, squares
        if _joint_deviations(products, size_rad).any():
            solved = _pose_inverse(products, size_rad) @ seen
            these = along - flat.T @ solved.reshape(-1, count)
            left = squares - (seen * solved).sum(axis=(0, 1))
        factor_rows, _ = _pose_factor(products, size_rad)
        total = products.gram[: products.declared, :-1] - factor_rows[:, : products.declared].T @ factor_rows[:, :-1]
        factor = np.linalg.cholesky(total[:, : products.declared])
        fitted = solve_triangular(factor, these[: products.declared], lower=True)
        cross = solve_triangular(factor, total[:, products.declared :], lower=True)
        np.subtract(these[products.declared :], cross.T @ fitted, out=found_along[number])
        found_squares[number] = left - (fitted**2).sum(axis=0)
    return found_along, found_squares


def _joint_deviations(products: Products, tau: float) -> np.ndarray:
    return np.sqrt(tau**2 + products.joint_rad**2)


def _pose_inverse(products: Products, tau: float) -> np.ndarray:
    """(Lambda^-1 + C_p)^-1 = Lambda^1/2 (I + Lambda^1/2 C_p Lambda^1/2)^-1 Lambda^1/2, ndarray (G, n, n)."""
    deviation = _joint_deviations(products, tau)
    inner = np.eye(len(deviation)) + deviation[:, None] * products.pose_gram * deviation
    return deviation[:, None] * np.linalg.inv(inner) * deviation


def _pose_factor(products: Products, tau: float) -> tuple[np.ndarray, float]:
    """Rows whose squares are what the pose error takes from Z'Z, and ln |Sigma| beyond that of white noise."""
    deviation = _joint_deviations(products, tau)
    width = products.pose_rows.shape[2]
    if not deviation.any():
        return np.zeros((0, width)), 0.0
    inner = np.eye(len(deviation)) + deviation[:, None] * products.pose_gram * deviation
    factor = np.linalg.cholesky(inner)
    rows = np.linalg.solve(factor, deviation[:, None] * products.pose_rows)
    log_det = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum()
    return rows.reshape(-1, width), float(log_det)
