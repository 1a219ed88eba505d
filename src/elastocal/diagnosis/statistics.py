"""All that the measurements say of a linearised model, in numbers whose count does not
grow with the measurements.

Measurements y = X beta + W gamma + e, with X the declared model's sensitivities and W
those of all candidates, both whitened by the noise of the measurements. The
measurements of a pose may have an error in common as well: that of the joints when the
pose was taken, of variance tau^2 I, seen through the Jacobian. By the matrix inversion
lemma (Hager, SIAM Review 1989)

    Z' Sigma(tau)^-1 Z = Z'Z - sum over poses B_p' (I / tau^2 + C_p)^-1 B_p,   B_p = J_p' Z_p,   C_p = J_p' J_p,   Z = [X W y],

so that one pass over the poses serves every tau. Columns are first made orthogonal to X
by a QR decomposition of the scaled rows: the condition number of X is not squared.
Marginalising beta gives W'MW, W'My, y'My with M = Sigma^-1 - Sigma^-1 X (X'Sigma^-1
X)^-1 X'Sigma^-1 and the determinants of restricted maximum likelihood (REML; Harville,
JASA 1977).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import solve_triangular

from elastocal.fitting.observations import batch_groups_by_size

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.fitting.linearization import FactoredSensitivities

# Products of one pose with all columns that are in memory at once.
_AT_ONCE = 1_000_000
# Of a square from which another one was taken, less than this share is rounding.
_INSIDE = 1e-12
# Columns for each row that a pose error takes from their products, from which on these
# cost less as they are.
_COLUMNS_A_ROW = 4


@dataclass(frozen=True)
class WhitenedRows:
    """Whitened rows of M observations in some whole poses.

    `declared` (M, rows, P): sensitivities to the declared parameters. `candidates`:
    sensitivities to the K columns of all candidates, in units of their plausible sizes.
    `residual` (M, rows). `jacobian` (M, rows, n): with respect to the joints. `pose`
    (M,) of int: from 0.
    """

    declared: np.ndarray
    candidates: FactoredSensitivities
    residual: np.ndarray
    jacobian: np.ndarray
    pose: np.ndarray

    def at(self, seen: np.ndarray) -> WhitenedRows:
        """Those of some whole poses, ndarray of bool (M,), which are numbered anew."""
        if seen.all():
            return self
        pose = np.unique(self.pose[seen], return_inverse=True)[1]
        return WhitenedRows(
            self.declared[seen],
            self.candidates.at(seen),
            self.residual[seen],
            self.jacobian[seen],
            pose,
        )


@dataclass(frozen=True)
class CrossProducts:
    """What `statistics_of` makes `Statistics` of, at any size of the pose error, and
    `null_draws` simulated ones.

    `beside` (M, rows, P + 1): declared columns of the rows made orthonormal, and the
    residual. `declared`: P. `gram` (P + K + 1 square): Z'Z of Z = [X W y], with the
    priors' rows. `freedom`: numbers measured less what the declared model fits.
    `into_basis` (P, P): turns declared columns into orthonormal ones. `projected` (P, K
    + 1): what these have in the others. `inside` (K,) of bool: columns of which these
    leave nothing. `met`: by sizes of the pose error, factors of what is left, and what
    is left of all other columns and the residual, as of `Statistics`.
    """

    rows: WhitenedRows
    basis_and_residual: np.ndarray
    declared_count: int
    gram: np.ndarray
    degrees_of_freedom: int
    basis_transform: np.ndarray
    projections: np.ndarray
    inside: np.ndarray
    met: dict[float, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = field(
        default_factory=dict, repr=False
    )

    @property
    def without_candidates(self) -> CrossProducts:
        """Of the declared model alone."""
        kept = np.append(np.arange(self.declared_count), -1)
        rows = replace(
            self.rows,
            candidates=self.rows.candidates.select_columns(
                np.zeros(len(self.inside), bool)
            ),
        )
        some: dict[str, Any] = {
            "gram": self.gram[np.ix_(kept, kept)],
            "projections": self.projections[:, -1:],
        }
        return replace(self, rows=rows, inside=self.inside[:0], met={}, **some)

    @property
    def without_rows(self) -> CrossProducts:
        """Without what grows with the measurements; normal equations at other sizes
        than those met are lost with it."""
        return replace(
            self,
            rows=self.rows.at(np.zeros(len(self.basis_and_residual), bool)),
            basis_and_residual=self.basis_and_residual[:0],
        )

    @property
    def axes(self) -> int:
        """Of each pose: as many as joints, or as numbers that are measured in any pose,
        if these are fewer."""
        rows = self.rows
        return min(
            rows.jacobian.shape[2],
            int(np.bincount(rows.pose).max()) * rows.jacobian.shape[1],
        )

    def iterate_poses(
        self,
    ) -> Iterator[tuple[np.ndarray, WhitenedRows, np.ndarray, np.ndarray]]:
        """B_p (G, a, P + K + 1) along principal axes of C_p, and its eigenvalues (G,
        a), of some poses at a time.

        With which of all rows are theirs, and these, their Jacobian along the same
        axes.
        """
        rows = self.rows
        count = self.declared_count
        axes = self.axes
        width = self.gram.shape[0]
        poses = int(rows.pose.max()) + 1
        step = max(_AT_ONCE // (width * axes), 1)
        for start in range(0, poses, step):
            seen = (rows.pose >= start) & (rows.pose < start + step)
            part = rows.at(seen)
            beside = (
                self.basis_and_residual
                if poses <= step
                else self.basis_and_residual[seen]
            )
            groups = batch_groups_by_size(part.pose)
            jacobian = np.empty((*part.jacobian.shape[:2], axes))
            found = np.empty((min(step, poses - start), axes, width))
            values = np.empty((min(step, poses - start), axes))
            for members in groups:
                mine = part.pose[members[:, 0]]
                flat = (len(members), members.shape[1] * beside.shape[1], -1)
                each = part.jacobian[members].reshape(flat)
                squares, directions = np.linalg.eigh(each.transpose(0, 2, 1) @ each)
                values[mine] = squares[:, -axes:]
                turned = each @ directions[..., -axes:]
                jacobian[members] = turned.reshape(*members.shape, *jacobian.shape[1:])
                together = turned.transpose(0, 2, 1) @ beside[members].reshape(flat)
                found[mine, :, :count] = together[..., :-1]
                found[mine, :, -1] = together[..., -1]
            found[..., count:-1] = part.candidates.multiply_by_pose(jacobian, part.pose)
            every = found.reshape(-1, width)
            every[:, count:] -= every[:, :count] @ self.projections
            found[..., count:-1][..., self.inside] = 0.0
            yield seen, replace(part, jacobian=jacobian), found, np.maximum(values, 0.0)


def compute_cross_products(
    rows: WhitenedRows, prior_std: np.ndarray, present: np.ndarray
) -> CrossProducts:
    """Gather the products of whitened rows.

    `prior_std` (P,): standard deviation of the prior of each declared parameter; wide
    ones keep the problem well posed. `present` (P,): present value of each less the
    mean of its prior.

    The declared columns are made orthonormal by QR of the scaled rows, so that no
    condition number is squared; what candidates have in them is taken off their
    products by Pythagoras' theorem, which costs 1e-16 of the square of a candidate:
    nothing beside noise of one. What the declared model fits are its effective degrees
    of freedom, the trace of its hat matrix (Hastie and Tibshirani, Generalized Additive
    Models, 1990).
    """
    observed, components, count = rows.declared.shape
    declared = rows.declared.reshape(observed * components, count)
    scaled = np.concatenate([declared, np.diag(1.0 / prior_std)])
    norms = np.linalg.norm(scaled, axis=0)
    basis, triangle = np.linalg.qr(scaled / norms)
    seen = basis[: len(declared)]
    residual = np.concatenate([rows.residual.ravel(), -present / prior_std])
    beside = np.concatenate([seen, rows.residual.reshape(-1, 1)], axis=1).reshape(
        observed, components, count + 1
    )
    products = rows.candidates.times(beside)
    projected = np.concatenate(
        [products[:, :-1].T, (basis.T @ residual)[:, None]], axis=1
    )
    left = residual - basis @ projected[:, -1]
    left -= basis @ (basis.T @ left)
    gram, squares = np.eye(projected.shape[1] + count), rows.candidates.gram()
    own = gram[count:-1, count:-1]
    along = products[:, -1] - projected[:, :-1].T @ projected[:, -1]
    np.subtract(squares, projected[:, :-1].T @ projected[:, :-1], out=own)
    inside = np.diag(own) <= _INSIDE * np.diag(squares)
    own[inside] = 0.0
    own[:, inside] = 0.0
    along[inside] = 0.0
    gram[count:-1, -1] = gram[-1, count:-1] = along
    gram[-1, -1] = left @ left
    freedom = max(round(len(declared) - (seen**2).sum()), 1)
    into_basis = np.linalg.inv(triangle) / norms[:, None]
    return CrossProducts(
        rows, beside, count, gram, freedom, into_basis, projected, inside
    )


@dataclass(frozen=True)
class SufficientStatistics:
    """Sufficient statistics at T sizes of the pose error, for K columns.

    `pose_error_rad` (T,): tau. `gram` (T or 1, K, K), `taken` (T, K, R): W'MW is the
    one less the product of the other with itself. Of few poses the one is of no pose
    error, for all tau; of many R is 0. `along` (T, K): W'My. `squares` (T,): y'My.
    `log_likelihood` (T,): what tau contributes alone: -1/2 ln |Sigma| - 1/2 ln
    |X'Sigma^-1 X|. `freedom`: rows less what the declared model fits.
    """

    pose_error_rad: np.ndarray
    gram: np.ndarray
    taken: np.ndarray
    score: np.ndarray
    residual_squares: np.ndarray
    log_likelihood: np.ndarray
    degrees_of_freedom: int

    def at(self, chosen: np.ndarray | slice) -> SufficientStatistics:
        """The same at some of the sizes of the pose error only; those beside each other
        are not copied."""
        if (
            not isinstance(chosen, slice)
            and len(chosen)
            and np.ptp(chosen) == len(chosen) - 1
        ):
            chosen = slice(int(chosen[0]), int(chosen[-1]) + 1)
        of_each = {
            name: each
            for name, each in vars(self).items()
            if name != "degrees_of_freedom" and len(each) == len(self.residual_squares)
        }
        return replace(self, **{name: each[chosen] for name, each in of_each.items()})

    def nearest(self, pose_error_rad: float) -> int:
        """Place of the size of the pose error that is nearest to one."""
        return int(np.argmin(np.abs(self.pose_error_rad - pose_error_rad)))

    def between(self, left: np.ndarray, right: np.ndarray | None = None) -> np.ndarray:
        """W'MW of some columns (..., d) with others (..., e), or with all, ndarray (T,
        ..., d, e)."""
        taken = self.taken[:, left]
        others = (
            self.taken
            if right is None
            else taken
            if right is left
            else self.taken[:, right]
        )
        found = (
            self.gram[:, left]
            if right is None
            else self.gram[:, left[..., None], right[..., None, :]]
        )
        return found - taken @ others.swapaxes(-1, -2)


def compute_statistics(
    products: CrossProducts, pose_error_rad: np.ndarray
) -> SufficientStatistics:
    """Sufficient statistics at some sizes of the pose error (T,)."""
    count = products.declared_count
    sizes = np.asarray(pose_error_rad)
    # Without a pose error declared columns are orthonormal, and the others have nothing
    # in them.
    above = np.tile(products.gram[:count], (len(sizes), 1, 1))
    rest = products.gram[None, count:, count:]
    rows = (int(products.rows.pose.max()) + 1) * products.axes
    few = (rows + count) * _COLUMNS_A_ROW < rest.shape[1]
    rest = rest if few else np.tile(rest, (len(sizes), 1, 1))
    taken = np.zeros((len(sizes), rest.shape[1], few * (rows + count)))
    start = 0
    log_dets = np.zeros(len(sizes))
    for _, _, found, values in products.iterate_poses() if sizes.any() else ():
        part = slice(start, start := start + values.size)
        for number in np.flatnonzero(sizes).tolist():
            tau = sizes[number]
            each = (found * (tau / np.sqrt(1.0 + tau**2 * values))[..., None]).reshape(
                -1, found.shape[2]
            )
            above[number] -= each[:, :count].T @ each
            beside = np.ascontiguousarray(each[:, count:])
            if few:
                taken[number, :, part] = beside.T
            else:
                rest[number] -= beside.T @ beside
            log_dets[number] += np.log1p(tau**2 * values).sum()
    factors = np.linalg.cholesky(above[:, :, :count])
    for number, tau in enumerate(sizes):
        fitted = above[number, :, count:]
        if tau:
            fitted = solve_triangular(factors[number], fitted, lower=True)
            if few:
                taken[number, :, start:] = fitted.T
            else:
                rest[number] -= fitted.T @ fitted
        products.met[float(tau)] = (
            factors[number],
            fitted,
            rest[0 if few else number],
            taken[number],
        )
    logs = -0.5 * log_dets - np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
    last = rest[:, -1] - (taken @ taken[:, -1, :, None])[..., 0]
    return SufficientStatistics(
        sizes,
        rest[:, :-1, :-1],
        taken[:, :-1],
        last[:, :-1],
        last[:, -1],
        logs,
        products.degrees_of_freedom,
    )


def assemble_normal_equations(
    products: CrossProducts, tau: float, columns: np.ndarray
) -> np.ndarray:
    """Z'Sigma(tau)^-1 Z of declared columns, some of the others (D,) and the residual,
    ndarray (P + D + 1, P + D + 1)."""
    if tau not in products.met:
        compute_statistics(products, np.array([tau]))
    some, (factor, fitted, rest, taken) = np.append(columns, -1), products.met[tau]
    fitted = fitted[:, some]
    taken = taken[some]
    across = factor @ fitted
    return np.block(
        [
            [factor @ factor.T, across],
            [across.T, rest[np.ix_(some, some)] - taken @ taken.T + fitted.T @ fitted],
        ]
    )


def simulate_null_statistics(
    products: CrossProducts,
    tau: float,
    pose_error_rad: np.ndarray,
    count: int,
    stream: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Statistics of simulated measurements of the declared model, in which nothing is
    missing: a parametric bootstrap.

    `tau`: pose error with which to simulate, rad. `pose_error_rad` (T,): at which the
    statistics are wanted. Returns `along` (T, K, N); `squares` (T, N): as in
    `Statistics`, for N draws of unit variance.
    """
    rows = products.rows
    declared = products.declared_count
    joints = rows.jacobian.shape[2]
    sizes = np.asarray(pose_error_rad)
    white = stream.standard_normal((*rows.residual.shape, count))
    fitted = np.tensordot(
        products.basis_and_residual[..., :-1], white, ((0, 1), (0, 1))
    )
    along = np.concatenate(
        [fitted, rows.candidates.times(white) - products.projections[:, :-1].T @ fitted]
    )
    squares = (white**2).sum(axis=(0, 1))
    known = np.tile(products.gram[:declared, :-1], (len(sizes), 1, 1))
    taken = np.zeros((len(sizes), *along.shape))
    off = np.zeros((len(sizes), count))
    for chosen, part, each, values in products.iterate_poses():
        flat = each.reshape(-1, each.shape[2])[:, :-1]
        values = values.reshape(-1, 1)
        drawn = white[chosen]
        by_pose = np.empty((*each.shape[:2], count))
        axes = each.shape[1]
        for members in batch_groups_by_size(part.pose):
            turned = (
                part.jacobian[members]
                .reshape(len(members), -1, axes)
                .transpose(0, 2, 1)
            )
            by_pose[part.pose[members[:, 0]]] = turned @ drawn[members].reshape(
                len(members), -1, count
            )
        seen = by_pose.reshape(-1, count)
        if tau:
            # Along the principal axes of a pose the errors of its joints are as
            # independent as they are themselves.
            errors = stream.standard_normal((len(each), joints, count))
            common = tau * errors[:, -axes:].reshape(seen.shape)
            squares += (common * (2 * seen + values * common)).sum(axis=0)
            along += flat.T @ common
            seen += values * common
        for number, size in enumerate(sizes):
            if size:
                share = size**2 / (1.0 + size**2 * values)
                solved = share * seen
                taken[number] += flat.T @ solved
                off[number] += (seen * solved).sum(axis=0)
                known[number] -= flat[:, :declared].T @ (share * flat)
    found_along = np.empty((len(sizes), len(along) - declared, count))
    found_squares = squares - off
    for number, total in enumerate(known):
        these = along - taken[number]
        factor = np.linalg.cholesky(total[:, :declared])
        fitted = solve_triangular(factor, these[:declared], lower=True)
        cross = solve_triangular(factor, total[:, declared:], lower=True)
        np.subtract(these[declared:], cross.T @ fitted, out=found_along[number])
        found_squares[number] -= (fitted**2).sum(axis=0)
    return found_along, found_squares
