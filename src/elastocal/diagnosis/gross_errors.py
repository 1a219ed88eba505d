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
from scipy.special import chdtri, fdtri, gammaincinv

from elastocal.counting import counted
from elastocal.fitting.linearization import linearize
from elastocal.fitting.model import conditions, parameters, residuals
from elastocal.fitting.noise import measurement_covariances
from elastocal.fitting.observations import parts_of, select_states, single_observations, spread_poses

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.linearization import Linearization
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.noise import Noise

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
    deviations. `gross` (N,) of bool. `yardstick`: by which they were judged, where they are those of a fit.
    """

    residual: np.ndarray
    distance: np.ndarray
    gross: np.ndarray
    yardstick: Yardstick | None = None

    @classmethod
    def none(cls, count: int, rows: int) -> Deviations:
        """Of rows that nothing is said of."""
        return cls(np.zeros((count, rows)), np.zeros(count), np.zeros(count, bool))


@dataclass(frozen=True)
class Yardstick:
    """What rows are judged by: noise of one row, and covariance (P, P) of the parameters under it, None where negligible."""

    noise: Noise
    covariance: np.ndarray | None


@dataclass(frozen=True)
class _Beside:
    """Rows of measurements beside a model, of which a sample and all that lie far off are looked at closely.

    `residual` (N, rows). `far` (N,): whole distance in standard deviations of the sensor, no less than that in those of a row.
    `sample`, `closely` (N,) of bool: poses spread over those kept; these, and what is as far off as a quarter of all. `parts`:
    which of the latter; their linearisation; variance (m, rows, rows) of each, and that of a radian in each joint.
    """

    residual: np.ndarray
    far: np.ndarray
    sample: np.ndarray
    closely: np.ndarray
    parts: list[tuple[slice, Linearization, np.ndarray, np.ndarray]]

    @classmethod
    def of(cls, model: Model, estimate: Estimate, measurements: Measurements, noise: Noise, kept: np.ndarray) -> _Beside:
        single, sample = single_observations(measurements), kept.copy()
        sample[kept] = spread_poses(select_states(single, kept), _MOST)
        near, residual = spread_poses(single, _MOST), np.empty((len(single), model.rows))
        if near.all():
            closely, far = near, np.zeros(len(single))
        else:
            for _, seen, part in parts_of(single, 0):
                residual[seen] = residuals(model, estimate, part, conditions(model, estimate, part.states))
            far = np.linalg.norm(residual / np.repeat([noise.position_m, noise.orientation_rad], 3)[: model.rows], axis=1)
            closely = near | sample | (far > np.quantile(far[near], _SCALE_QUANTILES[-1]))
        some, parts = select_states(single, closely), []
        for _, seen, part in parts_of(some, len(parameters(model, estimate))):
            line, spread = linearize(model, estimate, part, conditions(model, estimate, part.states)), noise.spread(part)
            jacobian = line.joint_jacobian
            own = measurement_covariances(noise, jacobian[:, None], model.rows, None if spread is None else spread[:, None])
            parts.append((seen, line, own, jacobian @ jacobian.transpose(0, 2, 1)))
        residual[closely] = np.concatenate([line.residual for _, line, _, _ in parts])
        return cls(residual, far, sample, closely, parts)

    def yardstick(self, fitted: Fit, noise: Noise, kept: np.ndarray) -> Yardstick:
        """As `yardstick_of`, by the rows that were fitted, (N,) of bool."""
        free, mine = ~fitted.held, self.sample[self.closely]
        negligible = self.sample.sum() < kept.sum() or not free.any()
        sizes = np.array([p.plausible for _, p in fitted.parameters])[free]
        best = (np.inf, Yardstick(noise, None))
        for share in _POSE_SHARES if fitted.noise.pose_rad else (0.0,):
            pose_rad, covariance = share * fitted.noise.pose_rad, None
            white = [np.linalg.inv(np.linalg.cholesky(own + pose_rad**2 * common)) for _, _, own, common in self.parts]
            if not negligible:
                information = np.diag((sizes / fitted.prior_std[free]) ** 2)
                for (seen, line, _, _), each in zip(self.parts, white, strict=True):
                    rows = (each @ (line.sensitivities[..., free] * sizes))[mine[seen]].reshape(-1, len(sizes))
                    information += rows.T @ rows
                covariance = np.zeros((len(free), len(free)))
                covariance[np.ix_(free, free)] = np.linalg.pinv(information, hermitian=True) * np.outer(sizes, sizes)
            distance = self._distances(white, covariance, np.ones(len(mine), bool))[mine]
            volume = -np.concatenate([np.log(np.diagonal(each, axis1=1, axis2=2)).sum(axis=1) for each in white])[mine].mean()
            rows = fitted.model.rows
            # Rows do not scatter less than the noise that is known of them: a share that says so is too large.
            spread = volume + rows * np.log(max(np.median(distance) / np.sqrt(2 * gammaincinv(rows / 2, 0.5)), 1.0))
            best = min(best, (spread, Yardstick(replace(noise, pose_rad=pose_rad), covariance)), key=lambda each: each[0])
        return best[1]

    def distances(self, yardstick: Yardstick, fitted: np.ndarray) -> np.ndarray:
        """From the prediction by the other rows, in standard deviations, (N,); `far` where nothing looks closely.

        ``fitted`` says which rows the parameters were fitted to, (N,): residuals of these are smaller, those of others larger.
        """
        found, pose_rad = self.far.copy(), yardstick.noise.pose_rad
        white = [np.linalg.inv(np.linalg.cholesky(own + pose_rad**2 * common)) for _, _, own, common in self.parts]
        found[self.closely] = self._distances(white, yardstick.covariance, fitted[self.closely])
        return found

    def _distances(self, white: list[np.ndarray], covariance: np.ndarray | None, fitted: np.ndarray) -> np.ndarray:
        found = np.empty(len(fitted))
        for (seen, line, _, _), each in zip(self.parts, white, strict=True):
            off = each @ line.residual[..., None]
            matrix = np.tile(np.eye(each.shape[1]), (len(each), 1, 1))
            if covariance is not None:
                rows = each @ line.sensitivities
                share = (rows.reshape(-1, len(covariance)) @ covariance).reshape(rows.shape) @ rows.transpose(0, 2, 1)
                matrix += np.where(fitted[seen], -1.0, 1.0)[:, None, None] * share
                own = fitted[seen] & (np.trace(share, axis1=1, axis2=2) > 1.0 - _LEAST_OWN)
                values, axes = np.linalg.eigh(matrix[own])
                matrix[own] = (axes * np.maximum(values, _LEAST_OWN)[:, None]) @ axes.transpose(0, 2, 1)
            found[seen] = np.sqrt((off * np.linalg.solve(matrix, off)).sum(axis=(1, 2)))
        return found


def yardstick_of(fitted: Fit, noise: Noise, measurements: Measurements) -> Yardstick:
    """What the rows that a model was fitted to say of themselves, beside the noise that was declared or repeats show.

    Of the error common to a pose that the fit states the share counts that makes the generalized variance of most rows smallest
    (an S-estimate [1]): the rest may be that of the very errors that are looked for, or of a law that is not linear.

    [1] Davies, P. L., Asymptotic behaviour of S-estimates of multivariate location parameters and dispersion matrices, Annals
        of Statistics 15, 1987.
    """
    every = np.ones(len(measurements), bool)
    return _Beside.of(fitted.model, fitted.estimate, measurements, noise, every).yardstick(fitted, noise, every)


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
    inside = distance <= scale * most_by_chance(len(distance), rows, settings)
    if inside.mean() < 1.0 - settings.gross_error_share:
        return distance / scale, np.zeros(len(distance), bool)
    scale = max(1.0, float(np.sqrt((distance[inside] ** 2).mean() / rows)))
    gross = distance > scale * most_by_chance(len(distance), rows, settings, inside.sum() * rows)
    return distance / scale, gross if gross.mean() <= settings.gross_error_share else np.zeros(len(gross), bool)


def most_by_chance(count: int, rows: int, settings: Settings, freedom: float = np.inf) -> float:
    """Standard deviations that the largest of so many good rows exceeds with the probability of the settings.

    ``freedom`` is that of the scale: infinite where it is known.
    """
    level = settings.gross_error_level / count
    return float(np.sqrt(chdtri(rows, level) if np.isinf(freedom) else rows * fdtri(rows, freedom, 1.0 - level)))


def gross_errors(fitted: Fit, noise: Noise, measurements: Measurements, kept: np.ndarray, settings: Settings) -> Deviations:
    """Judge the rows of a campaign by a fit to those that are ``kept``, (N,), and the noise declared or shown by repeats."""
    rows = _Beside.of(fitted.model, fitted.estimate, measurements, noise, kept)
    yardstick = rows.yardstick(fitted, noise, kept)
    distance = rows.distances(yardstick, kept)
    return Deviations(rows.residual, *beyond_chance(distance, fitted.model.rows, kept, settings), yardstick)


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
    every = np.ones(len(measurements), bool)
    rows = _Beside.of(model, estimate, measurements, yardstick.noise, every)
    distance, gross = beyond_chance(rows.distances(yardstick, ~every), model.rows, every, settings)
    least = settings.extrapolated_error
    if outside.sum() >= _FEWEST_TO_COMPARE:
        least = max(least, float(np.median(distance[outside])) / np.sqrt(2 * gammaincinv(model.rows / 2, 0.5)))
    far = distance > least * most_by_chance(len(distance), model.rows, settings)
    return Deviations(rows.residual, distance, gross & (far | ~outside))


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
