"""The rows of a case that are fitted: all but those that stand out, at first beside everything that the model might lack."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lapack, solve_triangular

from elastocal.diagnosis.evidence import scale_weights
from elastocal.diagnosis.gross_errors import beyond_chance, gross_errors, most_by_chance
from elastocal.diagnosis.linearize import linearized
from elastocal.diagnosis.statistics import mirror
from elastocal.fitting.least_squares import evaluated, fit
from elastocal.fitting.observations import measured_in, sample_of, select_states, spread_poses, without_outlying_repeats
from elastocal.fitting.tolerances import estimated_noise, fit_declared

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Measurements
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.statistics import WhiteRows
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations


@dataclass(frozen=True)
class Kept:
    """The part of a case that is fitted, ``kept`` of all its measurements (N,), with its noise and declared model.

    `searched`: observations that a search looks at, no more than so many; `declared` is the fit to these.
    """

    case: Case
    kept: np.ndarray
    noise: Noise
    warnings: list[str]
    declared: Fit
    searched: Observations

    def declared_to_all(self) -> Fit:
        """The declared model fitted to all that is kept."""
        if self.searched is self.case.observations:
            return self.declared
        found = self.declared
        return fit(found.model, self.case.observations, self.noise, found.estimate, reweighted=True)


def fitted_to(case: Case, kept: np.ndarray, settings: Settings, last: Kept | None = None) -> Kept:
    """The part of a case that is kept, or the last one where that is the same."""
    if last is not None and (kept == last.kept).all():
        return last
    part = case.select(kept)
    noise, warnings = estimated_noise(part)
    # Where rows only leave, the rest of the last sample.
    like = last.searched if last is not None and not (kept & ~last.kept).any() else None
    searched = sample_of(part.observations, settings.searched_observations, like)
    return Kept(part, kept, noise, warnings, fit_declared(part.model, searched, noise), searched)


def first_kept(case: Case, settings: Settings) -> Kept:
    """The part of a case that its declared model, or all candidates together, might explain.

    Rows under far larger loads than most are judged by the others alone: they would pull any fit to themselves (bad leverage
    points; Rousseeuw and Leroy, Robust Regression and Outlier Detection, 1987).
    """
    measurements, candidates = case.campaign.measurements, list(case.candidates.values())
    pulling = extreme_loads(measurements, settings)
    whole = part = fitted_to(case, ~pulling, settings)
    for _ in range(settings.gross_error_rounds):
        errors = gross_errors(part.declared, part.noise, measurements, part.kept, settings)
        last, part = part, fitted_to(case, ~errors.gross, settings, part)
        if part is last:
            break
    observations, most = case.observations, settings.gross_start_numbers // case.model.rows
    few = spread_poses(observations, most)
    if part is whole and not few.all():
        # Nothing stands apart, and there are too many to look more closely.
        return whole
    apart = np.unique(observations.state[measured_in(observations, measurements, ~part.kept)])
    few[apart[np.linspace(0, len(apart) - 1, min(len(apart), most)).astype(int)]] = True
    few[observations.state[measured_in(observations, measurements, pulling)]] = False
    some = select_states(observations, few)
    about = evaluated(part.declared.model, some, part.noise, part.declared.estimate)
    taken = improbable(linearized(about, some, candidates, settings))
    # A repeat far from its others is in no average, and stays what the declared model says of it.
    looked_at = measured_in(measurements, some, np.ones(len(some), bool))
    looked_at &= np.isin(measurements.row, without_outlying_repeats(measurements).row)
    return fitted_to(case, ~np.where(looked_at, measured_in(measurements, some, taken), ~part.kept), settings, whole)


def extreme_loads(measurements: Measurements, settings: Settings) -> np.ndarray:
    """Which rows are under a force far beyond that of most loaded ones, if these are few, ndarray of bool (N,)."""
    force = np.linalg.norm(measurements.wrench[:, :3], axis=1)
    if not force.any():
        return np.zeros(len(force), bool)
    far = force > settings.extreme_load * np.quantile(force[force > 0], 0.75)
    return far if far.mean() <= settings.gross_error_share else np.zeros(len(far), bool)


def improbable(line: Linearized) -> np.ndarray:
    """Which observations all candidates together do not explain, ndarray of bool (M,).

    The whitened residual has the covariance I + X D X' + W S W', with X the declared sensitivities, D their priors, W those
    of all candidates and S their mean square sizes. Observations are taken out, the worst first, until what is left agrees;
    then those come back that it predicts.
    """
    rows, settings = line.rows, line.settings
    observed, own = rows.residual.shape
    kept = np.ones(observed, bool)
    sizes = np.sqrt(np.exp(scale_weights(settings)) @ np.array(settings.scales) ** 2)
    declared = (rows.declared * line.priors[0]).reshape(rows.residual.size, -1)
    columns = (sizes * rows.candidates.dense()).reshape(rows.residual.size, -1)
    covariance, residual = np.eye(len(columns)) + columns @ columns.T, rows.residual.ravel()
    precision, limit = _precision(covariance, declared), most_by_chance(observed, own, settings)
    while kept.mean() > 1.0 - settings.gross_error_share:
        distance = _deletion_distances(precision, residual, kept, own)
        worst = int(np.argmax(distance))
        if distance[worst] <= limit:
            break
        kept[worst] = False
        precision = _without(precision, np.arange(worst * own, (worst + 1) * own))
    if not kept.all():
        covariance = covariance + _pose_error(rows, line.pose_errors_rad, covariance, declared, np.repeat(kept, own))
    whole = _precision(covariance, declared)
    while not kept.all():
        out = np.flatnonzero(np.repeat(~kept, own))
        distance = _deletion_distances(_without(whole, out), residual, kept, own)
        variance = np.linalg.inv(whole[np.ix_(out, out)])
        rest = (variance @ (whole @ residual)[out]).reshape(-1, own, 1)
        distance[~kept] = np.sqrt((rest * np.linalg.solve(_blocks(variance, own), rest)).sum(axis=(1, 2)))
        back = ~kept & ~beyond_chance(distance, own, kept, settings)[1]
        if not back.any():
            break
        kept |= back
    return ~kept


def _precision(covariance: np.ndarray, declared: np.ndarray) -> np.ndarray:
    """Inverse of a covariance to which that of declared columns of unit size is added (Woodbury's identity)."""
    root = np.linalg.cholesky(covariance)
    basis, _ = _declared_basis(root, declared)
    inverse = lapack.dpotri(root, lower=1)[0]
    mirror(inverse)
    beside = solve_triangular(root, basis, lower=True, trans="T")
    return inverse - beside @ beside.T


def _log_likelihood(covariance: np.ndarray, declared: np.ndarray, residual: np.ndarray) -> float:
    """Logarithm of the density of a residual of zero mean under that sum, but for a constant."""
    root = np.linalg.cholesky(covariance)
    basis, log_size = _declared_basis(root, declared)
    white = solve_triangular(root, residual, lower=True)
    squares = white @ white - ((basis.T @ white) ** 2).sum()
    return float(-0.5 * squares - np.log(np.diag(root)).sum() - log_size)


def _declared_basis(root: np.ndarray, declared: np.ndarray) -> tuple[np.ndarray, float]:
    """Whitened declared columns beside their priors, made orthonormal, (n, P) without the latter; half the log determinant."""
    white = solve_triangular(root, declared, lower=True)
    basis, triangle = np.linalg.qr(np.concatenate([white, np.eye(declared.shape[1])]))
    return basis[: len(declared)], float(np.log(np.abs(np.diag(triangle))).sum())


def _without(precision: np.ndarray, out: np.ndarray) -> np.ndarray:
    """The inverse covariance of the rows without some, in whose place it is zero."""
    left = precision - precision[:, out] @ np.linalg.solve(precision[np.ix_(out, out)], precision[out])
    left[out], left[:, out] = 0.0, 0.0
    return left


def _pose_error(
    rows: WhiteRows, pose_errors_rad: np.ndarray, covariance: np.ndarray, declared: np.ndarray, known: np.ndarray
) -> np.ndarray:
    """Covariance of the error common to a pose, at the size that makes the rows known most probable."""
    residual, own = rows.residual.ravel()[known], rows.residual.shape[1]
    jacobian, pose = rows.jacobian.reshape(len(known), -1), np.repeat(rows.pose, own)
    common = (jacobian @ jacobian.T) * (pose[:, None] == pose)
    best = (-np.inf, 0.0)
    for tau in pose_errors_rad:
        likely = _log_likelihood((covariance + tau**2 * common)[np.ix_(known, known)], declared[known], residual)
        best = max(best, (likely, float(tau)))
    return best[1] ** 2 * common


def _deletion_distances(precision: np.ndarray, residual: np.ndarray, kept: np.ndarray, own: int) -> np.ndarray:
    """Length of the deletion residual of each observation that is kept, 0 of others, (M,)."""
    blocks = np.where(kept[:, None, None], _blocks(precision, own), np.eye(own))
    along = (precision @ residual).reshape(-1, own, 1)
    squares = (along * np.linalg.solve(blocks, along)).sum(axis=(1, 2))
    return np.where(kept, np.sqrt(np.maximum(squares, 0.0)), 0.0)


def _blocks(matrix: np.ndarray, own: int) -> np.ndarray:
    """Blocks on the diagonal, ndarray (M, own, own)."""
    every = np.arange(len(matrix) // own)
    return matrix.reshape(len(every), own, len(every), own)[every, :, every]
