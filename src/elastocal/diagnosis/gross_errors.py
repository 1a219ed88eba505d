"""Rows that no model of the robot explains: a lost beam, a held point, a mistyped
angle. They are found, named and left out.

A row is judged by its distance from what the other rows predict, in standard deviations
(externally studentized residual; Cook and Weisberg, Residuals and Influence in
Regression, 1982), and is a gross error beyond what the largest of so many good rows
exceeds with a small probability (mean-shift outliers with Bonferroni's bound; Barnett
and Lewis, Outliers in Statistical Data, 1994). The unit is one standard deviation or,
where that is more, what the rows that do not stand out scatter: a model that does not
fit makes no row stand out. Before it is known what the model lacks, rows are predicted
by everything that it might lack at once (`improbable`); rows that the final model
explains after all are taken back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtri, fdtri, gammaincinv

from elastocal.counting import format_count
from elastocal.effects.conditions import at_states
from elastocal.fitting.linearization import linearize, linearize_coordinates
from elastocal.fitting.model import (
    compute_residuals,
    evaluate_conditions,
    list_parameters,
)
from elastocal.fitting.noise import Noise
from elastocal.fitting.normal_equations import compute_measurement_covariances
from elastocal.fitting.observations import (
    Observations,
    select_spread_poses,
    select_states,
    separate_measurements,
    split_into_blocks,
)

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.diagnosis.settings import Settings
    from elastocal.effects.conditions import Conditions
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model

# Shares of the distances from which the scale is estimated: the second sees tails that
# are heavier than normal ones.
_SCALE_QUANTILES = (0.5, 0.75)
# Least share of a row's variance that is its own and not that of the parameters fitted
# to it.
_LEAST_OWN = 0.01
# Shares of the error common to a pose that a fit states.
_POSE_SHARES = (0.0, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)
# Rows of which the scale is estimated at most, to a percent; more determine the
# parameters so well that one hardly counts.
_MOST = 4_000
# Extrapolated rows of which the usual error is known.
_FEWEST_TO_COMPARE = 5
# Gross errors that have a sentence each among the warnings; the table of residuals has
# all.
_MOST_NAMED = 10


@dataclass(frozen=True)
class OutlierTest:
    """Rows beside a model.

    `residual` (N, rows): m and rad, base axes. `distance` (N,): from what the other
    rows predict, in robust standard deviations. `gross` (N,) of bool.
    """

    residual: np.ndarray
    distance: np.ndarray
    gross: np.ndarray

    @classmethod
    def none(cls, count: int, rows: int) -> OutlierTest:
        """Of rows that nothing is said of."""
        return cls(np.zeros((count, rows)), np.zeros(count), np.zeros(count, bool))


@dataclass(frozen=True)
class PredictionUncertainty:
    """What rows are judged by: noise of one row, and covariance (P, P) of the
    parameters under it, None where negligible."""

    noise: Noise
    covariance: np.ndarray | None


@dataclass(frozen=True)
class _Beside:
    """Rows of measurements beside a model, of which a sample and all that lie far off
    are looked at closely.

    `residual` (N, rows). `far` (N,): whole distance in standard deviations of the
    sensor. `sample`, `closely` (N,): poses spread over those kept; these, and what is
    as far off as a quarter of all. `parts`: which of the latter; their sensitivities,
    None where so many rows were fitted that no parameter is unsure; variance (m, rows,
    rows) of each, and that of a radian in each joint. `noise`: of one row.
    """

    residual: np.ndarray
    far: np.ndarray
    sample: np.ndarray
    closely: np.ndarray
    parts: list[tuple[slice, np.ndarray | None, np.ndarray, np.ndarray]]
    noise: Noise

    @classmethod
    def of(
        cls,
        model: Model,
        estimate: Estimate,
        measurements: Measurements,
        noise: Noise,
        kept: np.ndarray,
        unsure: bool,
    ) -> _Beside:
        """Of rows that are ``kept``, (N,) of bool; ``unsure``: whether parameters are
        so."""
        single = separate_measurements(measurements)
        sample = kept.copy()
        sample[kept] = select_spread_poses(select_states(single, kept), _MOST)
        near = select_spread_poses(single, _MOST)
        residual = np.empty((len(single), model.rows))
        whole = (
            evaluate_conditions(model, estimate, single.states) if near.all() else None
        )

        def around(part: Observations, states: slice) -> Conditions:
            """Conditions, found once where all rows are looked at closely."""
            if whole is None:
                return evaluate_conditions(model, estimate, part.states)
            return whole if len(part) == len(single) else at_states(whole, states)

        for states, seen, part in split_into_blocks(single, 0):
            residual[seen] = compute_residuals(
                model, estimate, part, around(part, states)
            )
        far = np.linalg.norm(
            residual
            / np.repeat([noise.position_m, noise.orientation_rad], 3)[: model.rows],
            axis=1,
        )
        closely = near | sample | (far > np.quantile(far[near], _SCALE_QUANTILES[-1]))
        some = select_states(single, closely)
        parts = []
        for states, seen, part in split_into_blocks(
            some, len(list_parameters(model, estimate))
        ):
            line = (linearize if unsure else linearize_coordinates)(
                model, estimate, part, around(part, states)
            )
            jacobian = line.joint_jacobian
            own = compute_measurement_covariances(noise, jacobian[:, None], model.rows)
            parts.append(
                (
                    seen,
                    line.sensitivities if unsure else None,
                    own,
                    jacobian @ jacobian.transpose(0, 2, 1),
                )
            )
        return cls(residual, far, sample, closely, parts, noise)

    def yardstick(self, fitted: Fit) -> PredictionUncertainty:
        """As `yardstick_of`, by the sample."""
        free = ~fitted.unidentifiable
        mine = self.sample[self.closely]
        rows = fitted.model.rows
        negligible = any(by is None for _, by, _, _ in self.parts) or not free.any()
        sizes = np.array([p.plausible for _, p in fitted.parameters])[free]
        best = (np.inf, PredictionUncertainty(self.noise, None))
        for share in _POSE_SHARES if fitted.noise.pose_rad else (0.0,):
            covariance = None
            white = self._white(share * fitted.noise.pose_rad)
            if not negligible:
                information = np.diag((sizes / fitted.prior_std[free]) ** 2)
                for (seen, by, _, _), each in zip(self.parts, white, strict=True):
                    assert by is not None
                    seen_by = (each @ (by[..., free] * sizes))[mine[seen]].reshape(
                        -1, len(sizes)
                    )
                    information += seen_by.T @ seen_by
                covariance = np.zeros((len(free), len(free)))
                covariance[np.ix_(free, free)] = np.linalg.pinv(
                    information, hermitian=True
                ) * np.outer(sizes, sizes)
            distance = self._distances(white, covariance, np.ones(len(mine), bool))[
                mine
            ]
            volume = -np.concatenate(
                [
                    np.log(np.diagonal(each, axis1=1, axis2=2)).sum(axis=1)
                    for each in white
                ]
            )[mine].mean()
            # Rows do not scatter less than the noise that is known of them: a share
            # that says so is too large.
            spread = volume + rows * np.log(
                max(np.median(distance) / np.sqrt(2 * gammaincinv(rows / 2, 0.5)), 1.0)
            )
            found = PredictionUncertainty(
                replace(self.noise, pose_rad=share * fitted.noise.pose_rad), covariance
            )
            best = min(best, (spread, found), key=lambda each: each[0])
        return best[1]

    def distances(
        self, yardstick: PredictionUncertainty, fitted: np.ndarray
    ) -> np.ndarray:
        """From the prediction by the other rows, in standard deviations, (N,); `far`
        where nothing looks closely.

        ``fitted`` says which rows the parameters were fitted to, (N,): residuals of
        these are smaller, those of others larger.
        """
        found = self.far.copy()
        white = self._white(yardstick.noise.pose_rad)
        found[self.closely] = self._distances(
            white, yardstick.covariance, fitted[self.closely]
        )
        return found

    def _white(self, pose_rad: float) -> list[np.ndarray]:
        return [
            np.linalg.inv(np.linalg.cholesky(own + pose_rad**2 * common))
            for _, _, own, common in self.parts
        ]

    def _distances(
        self, white: list[np.ndarray], covariance: np.ndarray | None, fitted: np.ndarray
    ) -> np.ndarray:
        found = np.empty(len(fitted))
        residual = self.residual[self.closely]
        for (seen, by, _, _), each in zip(self.parts, white, strict=True):
            off = each @ residual[seen, :, None]
            matrix = np.tile(np.eye(each.shape[1]), (len(each), 1, 1))
            if covariance is not None:
                rows = each @ by
                share = (rows.reshape(-1, len(covariance)) @ covariance).reshape(
                    rows.shape
                ) @ rows.transpose(0, 2, 1)
                matrix += np.where(fitted[seen], -1.0, 1.0)[:, None, None] * share
                own = fitted[seen] & (
                    np.trace(share, axis1=1, axis2=2) > 1.0 - _LEAST_OWN
                )
                values, axes = np.linalg.eigh(matrix[own])
                matrix[own] = (
                    axes * np.maximum(values, _LEAST_OWN)[:, None]
                ) @ axes.transpose(0, 2, 1)
            found[seen] = np.sqrt((off * np.linalg.solve(matrix, off)).sum(axis=(1, 2)))
        return found


def estimate_prediction_uncertainty(
    fitted: Fit, noise: Noise, measurements: Measurements
) -> PredictionUncertainty:
    """What the rows that a model was fitted to say of themselves, beside the noise that
    was declared or repeats show.

    Of the error common to a pose that the fit states the share counts that makes the
    generalized variance of most rows smallest (an S-estimate; Davies, Annals of
    Statistics 1987): the rest may be that of the very errors that are looked for, or of
    a law that is not linear.
    """
    near = select_spread_poses(separate_measurements(measurements), _MOST)
    some = measurements.select(near)
    few = len(measurements) <= _MOST
    return _Beside.of(
        fitted.model, fitted.estimate, some, noise, near[near], few
    ).yardstick(fitted)


def flag_outliers(
    distance: np.ndarray, rows: int, kept: np.ndarray, settings: Settings
) -> tuple[np.ndarray, np.ndarray]:
    """Distances in units of their scale, and which of them are gross errors, (N,).

    ``rows`` says how many numbers a distance is of. Those not ``kept`` count as large
    for the first, robust scale; the second is the root mean square of what does not
    stand out by the first, and the limit that of an F distribution. Where more than
    `gross_error_share` of all stand out, none does: then it is the model that is wrong.
    """
    ordered = np.sort(np.where(kept, distance, np.inf))
    usual = ordered[(np.array(_SCALE_QUANTILES) * (len(ordered) - 1)).astype(int)]
    scale = np.max(
        usual[np.isfinite(usual)]
        / np.sqrt(2 * gammaincinv(rows / 2, _SCALE_QUANTILES))[np.isfinite(usual)],
        initial=1.0,
    )
    inside = distance <= scale * compute_critical_distance(
        len(distance), rows, settings
    )
    if inside.mean() < 1.0 - settings.gross_error_share:
        return distance / scale, np.zeros(len(distance), bool)
    scale = max(1.0, float(np.sqrt((distance[inside] ** 2).mean() / rows)))
    gross = distance > scale * compute_critical_distance(
        len(distance), rows, settings, inside.sum() * rows
    )
    return (
        distance / scale,
        gross
        if gross.mean() <= settings.gross_error_share
        else np.zeros(len(gross), bool),
    )


def compute_critical_distance(
    count: int, rows: int, settings: Settings, freedom: float = np.inf
) -> float:
    """Standard deviations that the largest of so many good rows exceeds with the
    probability of the settings.

    ``freedom`` is that of the scale: infinite where it is known.
    """
    level = settings.gross_error_level / count
    return float(
        np.sqrt(
            chdtri(rows, level)
            if np.isinf(freedom)
            else rows * fdtri(rows, freedom, 1.0 - level)
        )
    )


def find_gross_errors(
    fitted: Fit,
    noise: Noise,
    measurements: Measurements,
    kept: np.ndarray,
    settings: Settings,
) -> OutlierTest:
    """Judge the rows of a campaign by a fit to those that are ``kept``, (N,), and the
    noise declared or shown by repeats."""
    rows = _Beside.of(
        fitted.model, fitted.estimate, measurements, noise, kept, kept.sum() <= _MOST
    )
    distance = rows.distances(rows.yardstick(fitted), kept)
    return OutlierTest(
        rows.residual, *flag_outliers(distance, fitted.model.rows, kept, settings)
    )


def find_held_out_gross_errors(
    fitted: Fit,
    there: tuple[Model, Estimate],
    yardstick: PredictionUncertainty,
    held_out: Case,
    outside: np.ndarray,
    settings: Settings,
) -> OutlierTest:
    """Judge held-out rows by the rule of `gross_errors`, in the model and estimate that
    were carried to them.

    Where a prediction is extrapolated, ``outside`` (N,), the model errs first: such a
    row has to be farther off, and farther than most of them.
    """
    model, estimate = there
    measurements = held_out.campaign.measurements
    if model is not fitted.model or estimate is not fitted.estimate:
        yardstick = replace(yardstick, covariance=None)
    every = np.ones(len(measurements), bool)
    rows = _Beside.of(
        model,
        estimate,
        measurements,
        yardstick.noise,
        every,
        yardstick.covariance is not None,
    )
    distance, gross = flag_outliers(
        rows.distances(yardstick, ~every), model.rows, every, settings
    )
    least = settings.extrapolated_error
    if outside.sum() >= _FEWEST_TO_COMPARE:
        least = max(
            least,
            float(np.median(distance[outside]))
            / np.sqrt(2 * gammaincinv(model.rows / 2, 0.5)),
        )
    far = distance > least * compute_critical_distance(
        len(distance), model.rows, settings
    )
    return OutlierTest(rows.residual, distance, gross & (far | ~outside))


def describe_gross_errors(
    found: OutlierTest, campaign: Campaign, held_out: bool
) -> list[dict[str, Any]]:
    """Gross errors as verdict.json has them, each with its row, its size and a
    sentence."""
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
            "turn_rad": float(np.linalg.norm(found.residual[place, 3:]))
            if found.residual.shape[1] > 3
            else None,
            "standard_deviations": float(found.distance[place]),
            "detail": _sentence(found, campaign, int(place)),
        }
        for place in np.flatnonzero(found.gross)
    ]


def format_gross_error_warnings(entries: list[dict[str, Any]]) -> list[str]:
    """A sentence for each of the first gross errors, and how many more there are."""
    more = len(entries) - _MOST_NAMED
    rest = [f"{format_count(more, 'further row')} left out"] if more > 0 else []
    return [entry["detail"] for entry in entries[:_MOST_NAMED]] + rest


def _sentence(found: OutlierTest, campaign: Campaign, place: int) -> str:
    measurements = campaign.measurements
    off = found.residual[place]
    away = 1e3 * float(np.linalg.norm(off[:3]))
    size = f"{away:.3g} mm" if away < 1e3 else f"{1e-3 * away:.3g} m"
    size += f" and {1e3 * np.linalg.norm(off[3:]):.3g} mrad" if len(off) > 3 else ""
    alike = (measurements.position == measurements.position[place]).all(axis=1)
    alike[place] = False
    reason = (
        f", the same point as {campaign.place_of(int(measurements.row[np.argmax(alike)]))}"
        if alike.any()
        else ""
    )
    reason = reason if measurements.position[place].any() else ", reads 0, 0, 0"
    return f"{campaign.place_of(int(measurements.row[place]))}: {size} off{reason}, left out"
