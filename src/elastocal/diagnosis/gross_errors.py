"""Rows that no model of the robot explains: a lost beam, a held point, a mistyped angle. They are found, named and left out.

A row is judged by its deletion residual: its distance from what the other rows predict, in standard deviations (the externally
studentized residual [1]). Rows are a gross error beyond the distance that the largest of so many good rows exceeds with a
small probability (a test of mean-shift outliers with Bonferroni's bound [2]). The unit is one standard deviation or, where
that is more, what the rows that do not stand out scatter: a model that does not fit makes no row stand out.

Before it is known what the model lacks, the rows are predicted by everything that it might lack at once: the Gaussian process
whose covariance is that of all candidates at their prior sizes. The worst row is taken out, the others are predicted again, and
so on. Rows that the final model explains after all are taken back.

[1] Cook, R. D. and Weisberg, S., Residuals and Influence in Regression, section 2.2, Chapman and Hall, 1982.
[2] Barnett, V. and Lewis, T., Outliers in Statistical Data, section 8.2, Wiley, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.linalg import lapack, solve_triangular
from scipy.special import chdtri, fdtri, gammaincinv

from elastocal.counting import counted
from elastocal.diagnosis.evidence import scale_weights
from elastocal.fitting.displacement import conditions
from elastocal.fitting.linearization import linearize
from elastocal.fitting.memory import observations_at_once
from elastocal.fitting.noise import measurement_covariances
from elastocal.fitting.observations import part_at, parts_of, select_states, single_observations, spread_poses
from elastocal.fitting.prediction import residuals

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.diagnosis.linearize import Linearized
    from elastocal.diagnosis.settings import Settings
    from elastocal.diagnosis.statistics import WhiteRows
    from elastocal.fitting.case import Case
    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.linearization import Linearization
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations

# Shares of the distances from which the scale is estimated: the second sees tails that are heavier than normal ones.
_SCALE_QUANTILES = (0.5, 0.75)
# Least share of a row's variance that is its own and not that of the parameters fitted to it.
_LEAST_OWN = 0.01
# Shares of the error common to a pose that a fit states.
_POSE_SHARES = (0.0, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
# Rows of which the scale is estimated at most, to a percent; more determine the parameters so well that one hardly counts.
_MOST = 4_000
# Extrapolated rows of which the usual error is known.
_FEWEST_TO_COMPARE = 5
# Gross errors that have a sentence each among the warnings; the table of residuals has all.
_MOST_NAMED = 10


@dataclass(frozen=True)
class Deviations:
    """Rows beside a model.

    `residual` (N, rows): m and rad, base axes. `distance` (N,): from what the other rows predict, in robust standard
    deviations. `gross` (N,) of bool.
    """

    residual: np.ndarray
    distance: np.ndarray
    gross: np.ndarray

    @classmethod
    def none(cls, count: int, rows: int) -> Deviations:
        """Of rows that nothing is said of."""
        return cls(np.zeros((count, rows)), np.zeros(count), np.zeros(count, bool))


@dataclass(frozen=True)
class Yardstick:
    """What rows are judged by: noise of one row, and covariance (P, P) of the parameters under it, None where negligible."""

    noise: Noise
    covariance: np.ndarray | None


def yardstick_of(fitted: Fit, noise: Noise, measurements: Measurements) -> Yardstick:
    """What the rows that a model was fitted to say of themselves, beside the noise that was declared or repeats show.

    Of the error common to a pose that the fit states the share counts that makes the generalized variance of most rows smallest
    (an S-estimate [1]): the rest may be that of the very errors that are looked for, or of a law that is not linear.

    [1] Davies, P. L., Asymptotic behaviour of S-estimates of multivariate location parameters and dispersion matrices, Annals
        of Statistics 15, 1987.
    """
    single = single_observations(measurements)
    some = select_states(single, spread_poses(single, _MOST))
    free = ~fitted.held
    negligible = len(some) < len(single) or not free.any()
    priors = fitted.prior_std[free]
    sizes = np.array([p.plausible for _, p in fitted.parameters])[free]
    parts = parts_of(some, observations_at_once(fitted.model.rows, len(free)))
    lines = [_Line.of(fitted.model, fitted.estimate, part_at(some, *edges), noise) for edges in parts]
    best = (np.inf, Yardstick(noise, None))
    for share in _POSE_SHARES if fitted.noise.pose_rad else (0.0,):
        pose_rad, covariance = share * fitted.noise.pose_rad, None
        if not negligible:
            information = np.diag((sizes / priors) ** 2)
            for line in lines:
                seen = line.white(line.about.sensitivities[..., free] * sizes, pose_rad).reshape(-1, len(sizes))
                information += seen.T @ seen
            covariance = np.zeros((len(free), len(free)))
            covariance[np.ix_(free, free)] = np.linalg.pinv(information, hermitian=True) * np.outer(sizes, sizes)
        distance = np.concatenate([line.distance(pose_rad, covariance, np.ones(len(line.own), bool)) for line in lines])
        volume = np.concatenate([line.log_volume(pose_rad) for line in lines]).mean()
        rows = fitted.model.rows
        # Rows do not scatter less than the noise that is known of them: a share that says so is too large.
        spread = volume + rows * np.log(max(np.median(distance) / np.sqrt(2 * gammaincinv(rows / 2, 0.5)), 1.0))
        best = min(best, (spread, Yardstick(replace(noise, pose_rad=pose_rad), covariance)), key=lambda each: each[0])
    return best[1]


@dataclass(frozen=True)
class _Line:
    """Rows about an estimate: their linearisation, own variance (M, rows, rows), and that of a radian in each joint."""

    about: Linearization
    own: np.ndarray
    common: np.ndarray

    @classmethod
    def of(cls, model: Model, estimate: Estimate, some: Observations, noise: Noise) -> _Line:
        line = linearize(model, estimate, some, conditions(model, estimate, some.states))
        spread, jacobian = noise.spread(some), line.coordinate_jacobian[..., : model.sites.joints]
        own = measurement_covariances(noise, jacobian[:, None], model.rows, None if spread is None else spread[:, None])
        return cls(line, own, jacobian @ jacobian.transpose(0, 2, 1))

    def root(self, pose_rad: float) -> np.ndarray:
        """Cholesky factor of the variance of each row."""
        return np.linalg.cholesky(self.own + pose_rad**2 * self.common)

    def white(self, values: np.ndarray, pose_rad: float) -> np.ndarray:
        """Whitened values (M, rows, k)."""
        return np.linalg.inv(self.root(pose_rad)) @ values

    def log_volume(self, pose_rad: float) -> np.ndarray:
        """Half the logarithm of the determinant of each variance, (M,)."""
        return np.log(np.diagonal(self.root(pose_rad), axis1=1, axis2=2)).sum(axis=1)

    def distance(self, pose_rad: float, covariance: np.ndarray | None, fitted: np.ndarray) -> np.ndarray:
        """From the prediction by the other rows, in standard deviations, (M,)."""
        white = self.white(self.about.residual[..., None], pose_rad)[..., 0]
        if covariance is None:
            return np.linalg.norm(white, axis=1)
        seen = self.white(self.about.sensitivities, pose_rad)
        along = (seen.reshape(-1, seen.shape[2]) @ covariance).reshape(seen.shape)
        share, axes = np.linalg.eigh(along @ seen.transpose(0, 2, 1))
        own = np.where(fitted[:, None], np.maximum(1.0 - share, _LEAST_OWN), 1.0 + share)
        along = (axes.transpose(0, 2, 1) @ white[..., None])[..., 0]
        return np.sqrt((along**2 / own).sum(axis=1))


def deviations(
    model: Model, estimate: Estimate, measurements: Measurements, yardstick: Yardstick, fitted: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals of rows and their distances from the prediction, in standard deviations.

    ``fitted`` says which rows the parameters were fitted to, (N,): their residuals are smaller by it, those of others larger.
    """
    single, noise = single_observations(measurements), yardstick.noise
    near = spread_poses(single, _MOST)
    residual, distance = np.empty((len(single), model.rows)), np.empty(len(single))
    sensor = np.repeat([noise.position_m, noise.orientation_rad], 3)[: model.rows]
    for states, seen in parts_of(single, observations_at_once(model.rows, 0)):
        part = part_at(single, states, seen)
        residual[seen] = residuals(model, estimate, part, conditions(model, estimate, part.states))
        # No less than the whole distance, as the sensor is only a part of the variance.
        distance[seen] = np.linalg.norm(residual[seen] / sensor, axis=1)
    closely = near | (distance > np.quantile(distance[near], _SCALE_QUANTILES[-1]))
    some = select_states(single, closely)
    parts = parts_of(some, observations_at_once(model.rows, 0 if yardstick.covariance is None else len(yardstick.covariance)))
    distance[closely] = np.concatenate(
        [
            _Line.of(model, estimate, part_at(some, *edges), noise).distance(
                noise.pose_rad, yardstick.covariance, fitted[closely][edges[1]]
            )
            for edges in parts
        ]
    )
    return residual, distance


def beyond_chance(distance: np.ndarray, rows: int, kept: np.ndarray, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """Distances in units of their scale, and which of them are gross errors, (N,).

    ``rows`` says how many numbers a distance is of. Those not ``kept`` count as large for the first, robust scale; the second
    is the root mean square of what does not stand out by the first, and the limit that of an F distribution. Where more than
    `gross_error_share` of all stand out, none does: then it is the model that is wrong.
    """
    ordered = np.sort(np.where(kept, distance, np.inf))
    usual = ordered[(np.array(_SCALE_QUANTILES) * (len(ordered) - 1)).astype(int)]
    scale = np.max(
        usual[np.isfinite(usual)] / np.sqrt(2 * gammaincinv(rows / 2, _SCALE_QUANTILES))[np.isfinite(usual)], initial=1.0
    )
    inside = distance <= scale * _limit(len(distance), rows, settings)
    if inside.mean() < 1.0 - settings.gross_error_share:
        return distance / scale, np.zeros(len(distance), bool)
    scale = max(1.0, float(np.sqrt((distance[inside] ** 2).mean() / rows)))
    gross = distance > scale * _limit(len(distance), rows, settings, inside.sum() * rows)
    return distance / scale, gross if gross.mean() <= settings.gross_error_share else np.zeros(len(gross), bool)


def _limit(count: int, rows: int, settings: Settings, freedom: float = np.inf) -> float:
    """Standard deviations that the largest of so many good rows exceeds with the probability of the settings.

    ``freedom`` is that of the scale: infinite where it is known.
    """
    level = settings.gross_error_level / count
    return float(np.sqrt(chdtri(rows, level) if np.isinf(freedom) else rows * fdtri(rows, freedom, 1.0 - level)))


def gross_errors(fitted: Fit, noise: Noise, measurements: Measurements, kept: np.ndarray, settings: Settings) -> Deviations:
    """Judge the rows of a campaign by a fit to those that are ``kept``, (N,), and the noise declared or shown by repeats."""
    yardstick = yardstick_of(fitted, noise, measurements.select(kept))
    found = deviations(fitted.model, fitted.estimate, measurements, yardstick, kept)
    return Deviations(found[0], *beyond_chance(found[1], fitted.model.rows, kept, settings))


def held_out_gross_errors(
    fitted: Fit, there: tuple[Model, Estimate], yardstick: Yardstick, held_out: Case, outside: np.ndarray, settings: Settings
) -> Deviations:
    """Judge held-out rows by the rule of `gross_errors`, in the model and estimate that were carried to them.

    Where a prediction is extrapolated, ``outside`` (N,), it is first the model that errs: such a row has to be farther off, and
    farther than most of such rows.
    """
    model, estimate = there
    measurements = held_out.campaign.measurements
    if model is not fitted.model or estimate is not fitted.estimate:
        yardstick = replace(yardstick, covariance=None)
    unseen, every = np.zeros(len(measurements), bool), np.ones(len(measurements), bool)
    residual, distance = deviations(model, estimate, measurements, yardstick, unseen)
    distance, gross = beyond_chance(distance, model.rows, every, settings)
    least = settings.extrapolated_error
    if outside.sum() >= _FEWEST_TO_COMPARE:
        least = max(least, float(np.median(distance[outside])) / np.sqrt(2 * gammaincinv(model.rows / 2, 0.5)))
    far = distance > least * _limit(len(distance), model.rows, settings)
    return Deviations(residual, distance, gross & (far | ~outside))


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
    precision, limit = _precision(covariance, declared), _limit(observed, own, settings)
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
    inverse = np.tril(inverse) + np.tril(inverse, -1).T
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


def entries_of(found: Deviations, campaign: Campaign, held_out: bool) -> list[dict[str, Any]]:
    """Gross errors as verdict.json has them, each with its row, its size and a sentence."""
    measurements = campaign.measurements
    return [
        {
            "rows": [int(measurements.row[place])],
            "session": int(measurements.session[place]),
            "pose": int(measurements.pose[place]),
            "load": int(measurements.load[place]),
            "target": campaign.targets[measurements.target[place]].name,
            "held_out": held_out,
            "distance_m": float(np.linalg.norm(found.residual[place, :3])),
            "turn_rad": float(np.linalg.norm(found.residual[place, 3:])) if found.residual.shape[1] > 3 else None,
            "standard_deviations": float(found.distance[place]),
            "detail": _sentence(found, campaign, int(place)),
        }
        for place in np.flatnonzero(found.gross)
    ]


def warnings_of(entries: list[dict[str, Any]]) -> list[str]:
    """A sentence for each of the first gross errors, and how many more there are."""
    more = len(entries) - _MOST_NAMED
    return [entry["detail"] for entry in entries[:_MOST_NAMED]] + (
        [f"{counted(more, 'further row')} left out"] if more > 0 else []
    )


def _sentence(found: Deviations, campaign: Campaign, place: int) -> str:
    measurements, away = campaign.measurements, 1e3 * float(np.linalg.norm(found.residual[place, :3]))
    size = f"{away:.3g} mm" if away < 1e3 else f"{1e-3 * away:.3g} m"
    if found.residual.shape[1] > 3:
        size += f" and {1e3 * np.linalg.norm(found.residual[place, 3:]):.3g} mrad"
    alike = (measurements.position == measurements.position[place]).all(axis=1)
    alike[place] = False
    reason = ""
    if not measurements.position[place].any():
        reason = ", reads 0, 0, 0"
    elif alike.any():
        reason = f", the same point as {campaign.place_of(int(measurements.row[np.argmax(alike)]))}"
    return f"{campaign.place_of(int(measurements.row[place]))}: {size} off{reason}, left out"
