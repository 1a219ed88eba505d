"""Errors on poses that no step has seen: before and after, with intervals over poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import bdtrik

from elastocal.fitting.displacement import conditions, observations_at_once
from elastocal.fitting.linearization import linearize
from elastocal.fitting.noise import measurement_covariances
from elastocal.fitting.observations import part_at, parts_of
from elastocal.fitting.prediction import residuals
from elastocal.validation.bootstrap_t import drawn_poses, log_ratio_interval

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from elastocal.fitting.fit_result import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

METRICS = ("mean_m", "rms_m", "p95_m", "max_m")
_CONFIDENCE = 0.95
_ENDS = np.array([0.5 * (1.0 - _CONFIDENCE), 0.5 * (1.0 + _CONFIDENCE)])
_SHARE = 0.95
# A variance of a share below this is rounding.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Errors:
    """Position errors of observations.

    `distance` (M,): m. `cluster` (M,): pose of each, 0 .. P-1.
    """

    distance: np.ndarray
    cluster: np.ndarray

    @property
    def poses(self) -> int:
        """Number of poses."""
        return int(self.cluster.max()) + 1


def position_errors(model: Model, estimate: Estimate, observations: Observations) -> Errors:
    """Distances between measured and predicted positions.

    Parameters
    ----------
    model : Model
    estimate : Estimate
    observations : Observations

    Returns
    -------
    Errors
    """
    return Errors(np.linalg.norm(position_residuals(model, estimate, observations), axis=1), observations.cluster)


def position_residuals(model: Model, estimate: Estimate, observations: Observations) -> np.ndarray:
    """Measured less predicted positions, in parts that fit into memory.

    `model`, `estimate`, `observations`: as in `position_errors`. Returns (M, 3): m, base axes.
    """
    off = np.empty((len(observations), 3))
    for states, seen in parts_of(observations, observations_at_once(observations.rows, 0)):
        some = part_at(observations, states, seen)
        off[seen] = residuals(model, estimate, some, conditions(model, estimate, some.states))[:, :3]
    return off


def summary(distance: np.ndarray) -> dict[str, np.ndarray]:
    """Mean, RMS, 95th percentile and maximum.

    `distance` (..., M). Returns (...).
    """
    return {
        "mean_m": distance.mean(axis=-1),
        "rms_m": np.sqrt((distance**2).mean(axis=-1)),
        "p95_m": np.quantile(distance, 0.95, axis=-1),
        "max_m": distance.max(axis=-1),
    }


@dataclass(frozen=True)
class Reduction:
    """Share by which the RMS falls from one model to another on the same poses.

    `low`, `high`: 95 % interval.
    """

    low: float
    high: float
    std_error: float


def intervals(
    errors: Sequence[Errors], replicates: int, stream: np.random.Generator, reference: int = 0
) -> tuple[list[dict[str, np.ndarray]], list[Reduction]]:
    """95 % intervals of the summary, for as few poses as a campaign holds out.

    Poses are the independent units; measurements of one pose share errors. Mean and RMS, and the ratio of two RMS, have
    bootstrap-t intervals over poses, studentized by the delete-one-pose jackknife on the logarithmic scale ([1]_; [2]_ for
    clusters), and those of Student's t with the same standard error where poses are very few or many. The 95th percentile has
    the interval of Woodruff [3]_ at an effective number of measurements as by Korn and Graubard [4]_, without their correction
    for degrees of freedom; it is open above where that is less than 72. The maximum of a sample has no interval that a
    bootstrap could give [5]_: not a number, see `share_below_largest`. Why these, and what they cover:
    ``docs/held_out_intervals.md``.

    Parameters
    ----------
    errors : sequence of Errors
        Of several models for the same observations; every replicate draws the same poses for all.
    replicates : int
    stream : numpy.random.Generator
    reference : int
        Which of `errors` the reductions count from.

    Returns
    -------
    intervals : list of dict of str to ndarray (2,)
        For each of `errors`, m. Not a number with a single pose.
    reductions : list of Reduction
        From the reference to each.

    References
    ----------
    .. [1] Efron, B. and Tibshirani, R. J., An Introduction to the Bootstrap, sections 11.3 and 12.5, Chapman and Hall, 1993.
    .. [2] Cameron, A. C., Gelbach, J. B. and Miller, D. L., Bootstrap-based improvements for inference with clustered errors,
       Review of Economics and Statistics 90, 2008.
    .. [3] Woodruff, R. S., Confidence intervals for medians and other position measures, Journal of the American Statistical
       Association 47, 1952.
    .. [4] Korn, E. L. and Graubard, B. I., Confidence intervals for proportions with small expected number of positive counts
       estimated from survey data, Survey Methodology 24, 1998.
    .. [5] Bickel, P. J. and Freedman, D. A., Some asymptotic theory for the bootstrap, Annals of Statistics 9, 1981.
    """
    cluster, poses = errors[0].cluster, errors[0].poses
    weights = drawn_poses(poses, replicates, stream)
    counts = np.bincount(cluster).astype(float)
    sums = [np.bincount(cluster, one.distance) for one in errors]
    squares = [np.bincount(cluster, one.distance**2) for one in errors]
    found = [
        {
            "mean_m": np.exp(log_ratio_interval(total, counts, weights, _ENDS)[0]),
            "rms_m": np.exp(0.5 * log_ratio_interval(square, counts, weights, _ENDS)[0]),
            "p95_m": _quantile_interval(one),
            "max_m": np.full(2, np.nan),
        }
        for one, total, square in zip(errors, sums, squares, strict=True)
    ]
    return found, [_reduction(squares[reference], square, weights) for square in squares]


def share_below_largest(poses: int) -> float:
    """Share of all poses whose errors stay below the largest error seen, at 95 % confidence; free of any distribution.

    The one-sided tolerance limit of a sample's maximum [1].

    `poses`: poses drawn as those of later use are.

    [1] Wilks, S. S., Determination of sample sizes for setting tolerance limits, Annals of Mathematical Statistics 12, 1941.
    """
    return float((1.0 - _CONFIDENCE) ** (1.0 / poses))


def _reduction(before: np.ndarray, after: np.ndarray, weights: np.ndarray | None) -> Reduction:
    interval, error = log_ratio_interval(after, before, weights, _ENDS)
    ratio = np.sqrt(after.sum() / before.sum())
    high, low = 1.0 - np.exp(0.5 * interval)
    return Reduction(float(low), float(high), float(0.5 * ratio * error))


def _quantile_interval(errors: Errors) -> np.ndarray:
    """Interval (2,) of the 95th percentile by inverting the binomial test at the effective number of measurements."""
    rising, count, poses = np.sort(errors.distance), len(errors.distance), errors.poses
    if poses < 2:
        return np.full(2, np.nan)
    below = errors.distance <= np.quantile(errors.distance, _SHARE)
    share = below.mean()
    # Measurements of one pose are below together or above together: variance of the share over poses over that of independent
    # ones.
    off = np.bincount(errors.cluster, below - share)
    inflation = poses / (poses - 1) * (off**2).sum() / (count * max(share * (1.0 - share), _ROUNDING))
    effective = int(count / max(inflation, 1.0))
    low, high = np.ceil(bdtrik(_ENDS, effective, _SHARE))
    bottom = rising[int(low / effective * count) - 1] if low >= 1 else 0.0
    # So many measurements' worth that fewer than 2.5 % of such samples lie below the quantile as a whole.
    top = rising[int(np.ceil((high + 1) / effective * count)) - 1] if high < effective else np.inf
    return np.array([bottom, top])


def noise_floor(fitted: Fit, observations: Observations, model: Model, estimate: Estimate) -> float:
    """RMS position error that the noise alone leaves in observations.

    `fitted`: holds the noise. Returns m; not a number where the noise is not known.
    """
    if fitted.noise.source == "residual":
        return float("nan")
    variance = np.empty(len(observations))
    for states, seen in parts_of(observations, observations_at_once(observations.rows, len(fitted.held))):
        some = part_at(observations, states, seen)
        line = linearize(model, estimate, some, conditions(model, estimate, some.states))
        jacobian = line.coordinate_jacobian[:, None, :3, : model.sites.joints]
        spread = fitted.noise.spread(some)
        each = None if spread is None else spread[:, None]
        variance[seen] = np.trace(measurement_covariances(fitted.noise, jacobian, 3, each), axis1=1, axis2=2)
    return float(np.sqrt((variance / observations.states.repeats[observations.state]).mean()))


def errors_by_range(errors: Mapping[str, Errors], outside: np.ndarray) -> dict[str, Any]:
    """Errors before and after, inside and outside the range of the fitted poses.

    `errors`: by stage, for the same observations. `outside` (P,) of bool: see `fitted_range.outside_fitted_range`; by pose.
    Returns ``poses`` outside, and summaries of every stage ``inside`` and ``outside``, None where there is no such pose.
    """
    found: dict[str, Any] = {"poses": int(outside.sum())}
    for name, poses in (("inside", ~outside), ("outside", outside)):
        parts = {stage: one.distance[poses[one.cluster]] for stage, one in errors.items()}
        found[name] = {stage: _floats(summary(part)) for stage, part in parts.items()} if poses.any() else None
    return found


def _floats(values: Mapping[str, np.ndarray]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items()}


def grown(before: Mapping[str, float | np.ndarray], after: Mapping[str, float | np.ndarray]) -> list[str]:
    """Metrics of a summary that got worse."""
    return [name for name in METRICS if after[name] > before[name]]
