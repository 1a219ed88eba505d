"""Rows that no model of the robot explains: a lost beam, a held point, a mistyped
angle. They are found, reported and left out.

A row is judged by its distance from what the other rows predict (see
`studentized_residuals`). It is a gross error if the distance exceeds a critical value
that the largest of all good rows exceeds with a small probability: the mean-shift
outlier model with Bonferroni's bound [1]_. Distances are in units of the larger of one
standard deviation and the scatter of the inliers, so that a model with a systematic
misfit does not turn good rows into outliers.

References
----------
.. [1] Barnett and Lewis, Outliers in Statistical Data, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, fdtri

from elastocal.counting import format_count
from elastocal.diagnosis.studentized_residuals import (
    MAX_SAMPLE_SIZE,
    PredictionUncertainty,
    chi_quantile,
    examine_residuals,
)
from elastocal.verdict import GrossError

if TYPE_CHECKING:
    from elastocal.campaigns.campaign import Campaign, Measurements
    from elastocal.diagnosis.settings import Settings
    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Case, Estimate, Model
    from elastocal.fitting.noise import Noise

# Quantiles of the distances that estimate their scale. The upper quartile also sees
# tails that are heavier than those of a normal distribution.
_SCALE_QUANTILES = (0.5, 0.75)
# Number of extrapolated rows from which their own median distance is a reference.
_MIN_EXTRAPOLATED = 5
# Number of poses from which on rows that are far from the model and stay contradict it.
_MIN_STANDING_OUT = 2
# Probability of an error from which on it needs no mention.
_OVERWHELMING = 0.99
# Number of gross errors with a sentence of their own among the warnings; the table of
# residuals lists all of them.
_MAX_WARNINGS = 10


@dataclass(frozen=True)
class OutlierTest:
    """Outcome of the test for gross errors, of N rows with c components.

    Attributes
    ----------
    residual
        (N, c), m and rad, base axes.
    distance
        (N,), from the prediction by the other rows, in robust standard deviations.
    gross
        (N,) of bool, rows that are gross errors.
    distant
        (N,) of bool, rows beyond the critical distance; those that are no gross errors
        are more probably explained by an effect.
    probability
        (N,), that a row is wrong.
    """

    residual: np.ndarray
    distance: np.ndarray
    gross: np.ndarray
    distant: np.ndarray
    probability: np.ndarray

    @classmethod
    def none(cls, count: int, components: int) -> OutlierTest:
        """The outcome for rows that are not tested: no gross errors."""
        none = np.zeros(count, bool)
        return cls(
            np.zeros((count, components)), np.zeros(count), none, none, np.zeros(count)
        )

    @classmethod
    def by_distance(
        cls, residual: np.ndarray, distance: np.ndarray, distant: np.ndarray
    ) -> OutlierTest:
        """The outcome if every distant row is wrong."""
        return cls(residual, distance, distant, distant, distant.astype(float))


def flag_outliers(
    distance: np.ndarray, components: int, kept: np.ndarray, settings: Settings
) -> tuple[np.ndarray, np.ndarray]:
    """Scale distances and decide which of them are outliers.

    A first, robust scale from quantiles separates inliers; the second scale is their
    root mean square, with the critical distance of an F distribution. If more than
    `gross_error_share` of the rows stand out, none is an outlier: then the model is
    wrong, not the rows.

    Parameters
    ----------
    distance
        (N,), in standard deviations of the noise.
    components
        Number of components of a row.
    kept
        (N,) of bool. Rows that are not kept count as infinitely far in the first scale.
    settings
        Settings of the diagnosis.

    Returns
    -------
    ndarray, ndarray
        Scaled distances, (N,), and outliers, (N,) of bool.
    """
    count = len(distance)
    scale = _estimate_robust_scale(np.where(kept, distance, np.inf), components)
    inlier = distance <= scale * compute_critical_distance(count, components, settings)
    if inlier.mean() < 1.0 - settings.gross_error_share:
        return distance / scale, np.zeros(count, bool)
    scale = max(1.0, float(np.sqrt((distance[inlier] ** 2).mean() / components)))
    scale_freedom = inlier.sum() * components
    outlier = distance > scale * compute_critical_distance(
        count, components, settings, scale_freedom
    )
    if outlier.mean() > settings.gross_error_share:
        outlier = np.zeros(count, bool)
    return distance / scale, outlier


def _estimate_robust_scale(distance: np.ndarray, components: int) -> float:
    """The largest scale that a quantile of the distances implies, at least one;
    quantiles at infinity imply none."""
    ordered = np.sort(distance)
    ranks = (np.array(_SCALE_QUANTILES) * (len(ordered) - 1)).astype(int)
    quantiles = ordered[ranks]
    finite = np.isfinite(quantiles)
    expected = chi_quantile(_SCALE_QUANTILES, components)
    return np.max(quantiles[finite] / expected[finite], initial=1.0)


def compute_critical_distance(
    count: int, components: int, settings: Settings, scale_freedom: float = np.inf
) -> float:
    """Compute the distance that the largest of all good rows exceeds with the
    probability `gross_error_level`, in standard deviations.

    Parameters
    ----------
    count
        Number of rows, for Bonferroni's bound.
    components
        Number of components of a row.
    settings
        Settings of the diagnosis.
    scale_freedom
        Degrees of freedom of the estimated standard deviation; infinite if it is known.
    """
    level = settings.gross_error_level / count
    if np.isinf(scale_freedom):
        return float(np.sqrt(chdtri(components, level)))
    return float(np.sqrt(components * fdtri(components, scale_freedom, 1.0 - level)))


def find_extreme_loads(measurements: Measurements, settings: Settings) -> np.ndarray:
    """Find the rows under forces far beyond those of most loaded rows.

    Returns
    -------
    ndarray
        (N,) of bool; none if there are too many to be exceptions.
    """
    force = np.linalg.norm(measurements.wrench[:, :3], axis=1)
    loaded = force > 0
    if not loaded.any():
        return loaded
    extreme = force > settings.extreme_load * np.quantile(force[loaded], 0.75)
    return extreme & (extreme.mean() <= settings.gross_error_share)


def find_gross_errors(
    fitted: Fit,
    noise: Noise,
    measurements: Measurements,
    kept: np.ndarray,
    settings: Settings,
) -> OutlierTest:
    """Test all rows of a campaign against a fit.

    Parameters
    ----------
    fitted
        A fit to the rows that are kept.
    noise
        Noise of one row as it was declared or as repeats show it.
    measurements
        N rows.
    kept
        (N,) of bool, rows that were fitted.
    settings
        Settings of the diagnosis.
    """
    rows = examine_residuals(
        fitted.model,
        fitted.estimate,
        measurements,
        noise,
        kept,
        include_parameters=kept.sum() <= MAX_SAMPLE_SIZE,
    )
    distance = rows.compute_distances(rows.estimate_uncertainty(fitted), kept)
    scaled, gross = flag_outliers(distance, fitted.model.rows, kept, settings)
    return OutlierTest.by_distance(rows.residual, scaled, gross)


def find_held_out_gross_errors(
    model: Model,
    estimate: Estimate,
    uncertainty: PredictionUncertainty,
    held_out: Case,
    extrapolated: np.ndarray,
    settings: Settings,
) -> OutlierTest:
    """Test held-out rows, none of which was fitted, as `find_gross_errors` does.

    An extrapolated prediction has an error of its own. Such a row is a gross error only
    if it is also several times the critical distance away, and farther than most
    extrapolated rows.

    Parameters
    ----------
    model, estimate
        What predicts the held-out rows.
    uncertainty
        How far good rows are from their predictions.
    held_out
        Case of N rows.
    extrapolated
        (N,) of bool, rows at poses outside the fitted range.
    settings
        Settings of the diagnosis.
    """
    measurements = held_out.campaign.measurements
    kept = np.ones(len(measurements), bool)
    rows = examine_residuals(
        model,
        estimate,
        measurements,
        uncertainty.noise,
        kept,
        include_parameters=uncertainty.parameter_covariance is not None,
    )
    fitted = np.zeros(len(measurements), bool)
    distance = rows.compute_distances(uncertainty, fitted)
    scaled, gross = flag_outliers(distance, model.rows, kept, settings)
    factor = settings.extrapolated_error
    if extrapolated.sum() >= _MIN_EXTRAPOLATED:
        median = float(np.median(scaled[extrapolated]))
        factor = max(factor, median / float(chi_quantile(0.5, model.rows)))
    limit = factor * compute_critical_distance(len(scaled), model.rows, settings)
    gross &= ~extrapolated | (scaled > limit)
    return OutlierTest.by_distance(rows.residual, scaled, gross)


def describe_gross_errors(
    outcome: OutlierTest, campaign: Campaign, *, held_out: bool
) -> list[GrossError]:
    """Describe the gross errors of a campaign by their rows, sizes and a sentence.

    Parameters
    ----------
    outcome
        Of the test of the campaign's rows.
    campaign
        The campaign.
    held_out
        Whether its rows are held out.
    """
    measurements = campaign.measurements
    gross_errors = []
    for index in np.flatnonzero(outcome.gross).tolist():
        residual = outcome.residual[index]
        turn_rad = float(np.linalg.norm(residual[3:])) if len(residual) > 3 else None
        gross_errors.append(
            GrossError(
                rows=(int(measurements.row[index]),),
                session=int(measurements.session[index]),
                pose=int(measurements.pose[index]),
                load=int(measurements.load[index]),
                target=campaign.targets[measurements.target[index]].name,
                held_out=held_out,
                distance_m=float(np.linalg.norm(residual[:3])),
                turn_rad=turn_rad,
                standard_deviations=float(outcome.distance[index]),
                probability=float(outcome.probability[index]),
                detail=_format_gross_error(outcome, campaign, index),
            )
        )
    return gross_errors


def describe_standing_out(
    standing_out: np.ndarray, campaign: Campaign, least_poses: int = _MIN_STANDING_OUT
) -> list[str]:
    """Describe rows that are far from the model and stay, in one sentence; none if they
    are of fewer poses than `least_poses`: a single one may be one accident that is too
    small to be called so.

    Parameters
    ----------
    standing_out
        (N,) of bool.
    campaign
        The campaign.
    least_poses
        Fewest poses that are described.
    """
    poses = len(np.unique(campaign.measurements.pose[standing_out]))
    if poses < least_poses:
        return []
    rows = format_count(int(standing_out.sum()), "row")
    return [
        f"{rows} of {format_count(poses, 'pose')} are far from the model and are kept:"
        " an effect that acts there, and that the model lacks, is more probable than so"
        " many gross errors"
    ]


def format_gross_error_warnings(gross_errors: list[GrossError]) -> list[str]:
    """A sentence for each of the first gross errors, and the number of the others."""
    sentences = [error.detail for error in gross_errors[:_MAX_WARNINGS]]
    remaining = len(gross_errors) - len(sentences)
    if remaining:
        sentences.append(f"{format_count(remaining, 'further row')} left out")
    return sentences


def _find_cause(campaign: Campaign, index: int) -> str:
    """The cause of a wrong position, if it shows: a lost or a held point."""
    measurements = campaign.measurements
    position = measurements.position
    same_position = (position == position[index]).all(axis=1)
    same_position[index] = False
    if not position[index].any():
        return ", reads 0, 0, 0"
    if same_position.any():
        first = int(measurements.row[np.argmax(same_position)])
        return f", the same point as {campaign.locate_row(first)}"
    return ""


def _format_gross_error(outcome: OutlierTest, campaign: Campaign, index: int) -> str:
    """A sentence with the line of a row in its file, the size of its residual, the
    cause if it shows, and how probable it is that the row is wrong, if that is less
    than overwhelming."""
    measurements = campaign.measurements
    residual = outcome.residual[index]
    line = campaign.locate_row(int(measurements.row[index]))
    distance_mm = 1e3 * float(np.linalg.norm(residual[:3]))
    size = f"{distance_mm:.3g} mm"
    if distance_mm >= 1e3:
        size = f"{1e-3 * distance_mm:.3g} m"
    if len(residual) > 3:
        size += f" and {1e3 * np.linalg.norm(residual[3:]):.3g} mrad"
    cause = ""
    if measurements.channel is None:
        cause = _find_cause(campaign, index)
    probability = outcome.probability[index]
    uncertainty = ""
    if probability < _OVERWHELMING:
        uncertainty = f", wrong with a probability of {100 * probability:.0f} %"
    return f"{line}: {size} off{cause}{uncertainty}, left out"
