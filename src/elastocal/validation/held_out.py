"""Errors on held-out poses, with intervals over poses, and on poses left out of a fit.

One Gauss-Newton step from the fit to all observations leads to the fit without a part
of them (Cook and Weisberg, Residuals and Influence in Regression, 2.2, 1982). If only
the errors of a few poses matter, this step is used in closed form. For a refit, exact
residuals after the step confirm it, or further steps follow. A parameter that only the
omitted part identifies returns to where a fit starts, to its prior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from elastocal.fitting.covariance import factor_covariance
from elastocal.fitting.least_squares import (
    INTERMEDIATE_TOLERANCE,
    fit_model,
    register_placement,
)
from elastocal.fitting.linearization import linearize_coordinates
from elastocal.fitting.model import (
    compute_residuals,
    evaluate_conditions,
    place_in_session,
    predict,
)
from elastocal.fitting.observations import select_states, split_into_blocks
from elastocal.fitting.sensor_noise import compute_sensor_roots
from elastocal.mechanics.kinematics import compute_pose_differences
from elastocal.validation.transfer import place_unseen_sessions

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.noise import Noise
    from elastocal.fitting.observations import Observations
    from elastocal.measuring.channels import MeasuringPlan

METRICS = ("mean_m", "rms_m", "p95_m", "max_m")
_CONFIDENCE = 0.95
_QUANTILES = np.array([0.5 * (1.0 - _CONFIDENCE), 0.5 * (1.0 + _CONFIDENCE)])
# Outside this range of poses, Student's t with the same standard error replaces the
# bootstrap-t. With fewer poses the bootstrap-t is erratic (3 poses: it covers 80 %,
# Student's t 94 %; 6 poses: both cover the same). With more, the two are alike (300
# poses: widths differ by 3 %) and drawing is expensive.
_MIN_BOOTSTRAP_POSES = 6
_MAX_BOOTSTRAP_POSES = 300
# Intervals extend at most as many standard errors as those of Student's t with this
# many degrees of freedom. If one pose makes most of the error, replicates without it
# extend arbitrarily far; in simulations the limit costs no coverage (3 degrees: 2 %).
_MIN_DEGREES_OF_FREEDOM = 2
# Smaller standard errors of a logarithm are rounding.
_LOG_ROUNDING = 1e-12
# A pose alone determines some parameters, such as the frame of a session of one pose.
# They leave none of its error: smaller shares of it are rounding.
_SHARE_ROUNDING = 1e-9


@dataclass(frozen=True)
class PositionErrors:
    """Position errors of M observations.

    Attributes
    ----------
    distance : (M,) array, m
    cluster : (M,) int array, pose of each observation, 0 .. P-1
    """

    distance: np.ndarray
    cluster: np.ndarray

    @property
    def poses(self) -> int:
        """Number of poses."""
        return int(self.cluster.max()) + 1


def compute_position_errors(
    model: Model, estimate: Estimate, observations: Observations
) -> PositionErrors:
    """Compute distances between measured and predicted positions."""
    residuals = compute_position_residuals(model, estimate, observations)
    return PositionErrors(np.linalg.norm(residuals, axis=1), observations.cluster)


def compute_position_residuals(
    model: Model, estimate: Estimate, observations: Observations
) -> np.ndarray:
    """Compute measured minus predicted positions, (M, 3) array, m, base axes.

    Blocks of observations that fit into memory are processed one after another.
    """
    residuals = []
    for _, _, block in split_into_blocks(observations, 0):
        conditions = evaluate_conditions(model, estimate, block.states)
        residuals.append(compute_residuals(model, estimate, block, conditions)[:, :3])
    return np.concatenate(residuals)


def compute_errors_as_read(
    model: Model, estimate: Estimate, observations: Observations, plan: MeasuringPlan
) -> np.ndarray:
    """Compute measured minus predicted numbers of a kind such as `board`.

    Its measurements are fitted as poses of the target, whose errors differ: a rotation of
    a board moves a camera that sees it by the range.

    Returns
    -------
    (M, 6) array, m and rad, in the axes of the instrument
    """
    assert observations.rotation is not None
    kind = plan.kinds[0]
    options = {"camera": plan.camera}
    conditions = evaluate_conditions(model, estimate, observations.states)
    predicted = place_in_session(
        estimate, observations, *predict(model, estimate, observations, conditions)
    )
    return compute_pose_differences(
        *kind.convert(observations.position, observations.rotation, options),
        *kind.convert(predicted.position, predicted.rotation, options),
    )


def summarize_errors(distance: np.ndarray) -> dict[str, float]:
    """Compute mean, RMS, 95th percentile and maximum of distances (M,)."""
    return {
        "mean_m": float(distance.mean()),
        "rms_m": float(np.sqrt((distance**2).mean())),
        "p95_m": float(np.quantile(distance, 0.95)),
        "max_m": float(distance.max()),
    }


@dataclass(frozen=True)
class Reduction:
    """Share by which the RMS falls from one model to another on the same poses.

    `low` and `high` are its 95 % interval.
    """

    low: float
    high: float
    std_error: float


def compute_error_intervals(
    errors: Sequence[PositionErrors],
    replicates: int,
    stream: np.random.Generator,
    reference: int = 0,
) -> tuple[list[dict[str, np.ndarray]], list[Reduction]]:
    """Compute 95 % intervals of the summary, for as few poses as a campaign holds out.

    Measurements of one pose share errors. Mean and RMS, and the ratio of two RMS, have
    bootstrap-t intervals over poses, studentized by the delete-one-pose jackknife on
    the logarithmic scale [1]_ [2]_, and those of Student's t with the same standard
    error if poses are very few or many. Quantiles of so few poses have none. Their
    coverage: docs/held_out_intervals.md.

    Parameters
    ----------
    errors : sequence of PositionErrors
        Of several models for the same observations. Every replicate draws the same
        poses for all.
    replicates : int
    stream : numpy.random.Generator
    reference : int
        Index of the errors from which reductions count.

    Returns
    -------
    intervals : for each of `errors`, a (2,) array for each metric, m
        Not a number if there is no interval, as with a single pose.
    reductions : list of Reduction, from the reference to each of `errors`

    References
    ----------
    .. [1] Efron and Tibshirani, An Introduction to the Bootstrap, 11.3 and 12.5.
    .. [2] Cameron, Gelbach and Miller 2008, for clusters.
    """
    cluster = errors[0].cluster
    weights = _draw_pose_weights(errors[0].poses, replicates, stream)
    counts = np.bincount(cluster).astype(float)
    no_interval = np.full(2, np.nan)
    squares = [np.bincount(cluster, model.distance**2) for model in errors]
    intervals = []
    for model, square in zip(errors, squares, strict=True):
        totals = np.bincount(cluster, model.distance)
        log_mean, _ = _log_ratio_interval(totals, counts, weights)
        log_mean_square, _ = _log_ratio_interval(square, counts, weights)
        intervals.append(
            {
                "mean_m": np.exp(log_mean),
                "rms_m": np.exp(0.5 * log_mean_square),
                "p95_m": no_interval,
                "max_m": no_interval,
            }
        )
    before = squares[reference]
    return intervals, [_compute_reduction(before, after, weights) for after in squares]


def _compute_reduction(
    before: np.ndarray, after: np.ndarray, weights: np.ndarray | None
) -> Reduction:
    """Reduction of the RMS from squared errors (P,) of each pose before and after."""
    log_ratio, error = _log_ratio_interval(after, before, weights)
    high, low = 1.0 - np.exp(0.5 * log_ratio)
    std_error = 0.5 * np.sqrt(after.sum() / before.sum()) * error
    return Reduction(float(low), float(high), float(std_error))


def _draw_pose_weights(
    poses: int, replicates: int, stream: np.random.Generator
) -> np.ndarray | None:
    """How often each pose counts in each bootstrap replicate, (B, P) array.

    None if Student's t is used instead.
    """
    if not _MIN_BOOTSTRAP_POSES <= poses <= _MAX_BOOTSTRAP_POSES:
        return None
    weights = stream.multinomial(poses, np.full(poses, 1.0 / poses), replicates)
    # A replicate of one pose alone has no standard error.
    return weights[(weights > 0).sum(axis=1) > 1].astype(float)


def _log_ratio_interval(
    numerator: np.ndarray, denominator: np.ndarray, weights: np.ndarray | None
) -> tuple[np.ndarray, float]:
    """Interval (2,) of the log ratio of two totals over poses, and its standard error.

    `numerator` and `denominator` (P,) are those of each pose, `weights` as
    `_draw_pose_weights` returns them.
    """
    poses = len(numerator)
    if poses < 2:
        return np.full(2, np.nan), np.nan
    (value,), (error,) = _log_ratios(np.ones((1, poses)), numerator, denominator)
    if error <= _LOG_ROUNDING:
        return np.full(2, value), 0.0
    if weights is None:
        return value + error * stdtrit(poses - 1, _QUANTILES), error
    drawn, errors = _log_ratios(weights, numerator, denominator)
    scattered = errors > _LOG_ROUNDING
    pivots = (drawn - value)[scattered] / errors[scattered]
    limit = stdtrit(_MIN_DEGREES_OF_FREEDOM, _QUANTILES[1])
    pivot_quantiles = np.quantile(pivots, _QUANTILES[::-1]).clip(-limit, limit)
    return value - error * pivot_quantiles, error


def _log_ratios(
    weights: np.ndarray, numerator: np.ndarray, denominator: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of the ratio of weighted totals, and their jackknife standard errors,
    (B,) arrays."""
    poses = len(numerator)
    total = weights @ numerator
    total_below = weights @ denominator
    ratio_without = (total[:, None] - numerator) / (total_below[:, None] - denominator)
    # A pose that was not drawn cannot be left out.
    log_without = np.log(np.where(weights > 0, ratio_without, 1.0))
    mean = (weights * log_without).sum(axis=1) / poses
    deviation = log_without - mean[:, None]
    variance = (poses - 1) / poses * (weights * deviation**2).sum(axis=1)
    return np.log(total / total_below), np.sqrt(variance)


def bound_share_below_maximum(poses: int) -> float:
    """Bound the share of all poses whose errors stay below the largest of a sample.

    The bound holds at 95 % confidence for any distribution: the one-sided tolerance
    limit of a sample's maximum (Wilks, Annals of Mathematical Statistics 12, 1941).
    """
    return float((1.0 - _CONFIDENCE) ** (1.0 / poses))


def compute_noise_floor(
    fitted: Fit, observations: Observations, model: Model, estimate: Estimate
) -> float:
    """Compute the RMS position error, m, that the noise of a fit alone causes.

    Not a number if the noise is only known from the residual.
    """
    noise = fitted.noise
    if noise.source == "residual":
        return float("nan")
    total = 0.0
    for _, _, block in split_into_blocks(observations, len(fitted.unidentifiable)):
        variance = np.full((len(block), min(block.rows, 3)), noise.position_m**2)
        roots = compute_sensor_roots(model, estimate, block, noise)
        if roots is not None:
            variance = (roots[:, :3] ** 2).sum(axis=2)
        if noise.joint_rad.any():
            conditions = evaluate_conditions(model, estimate, block.states)
            linear_model = linearize_coordinates(model, estimate, block, conditions)
            joint_errors = linear_model.joint_jacobian[:, :3] * noise.joint_rad
            variance += (joint_errors**2).sum(axis=2)
        total += (variance.sum(axis=1) / block.states.repeats[block.state]).sum()
    return float(np.sqrt(total / len(observations)))


def compute_scatter(fitted: Fit, measured: Noise, observations: Observations) -> float:
    """Compute the ratio of the noise that a fit leaves to the measured noise.

    Parameters
    ----------
    fitted : Fit
        Its noise is the measured one, scaled, or comes from the sensor alone.
    measured : Noise
        Noise of the repeats, or declared noise.
    observations : Observations
        What was fitted.

    Returns
    -------
    float
        Ratio of the standard deviations of single measurements, without errors common
        to a pose.
    """
    if fitted.noise.joint_rad.any() or not measured.joint_rad.any():
        return fitted.noise.position_m / measured.position_m
    # The measured noise comes from sensor and joints; its sum in position counts.
    by_sensor, by_both = (
        compute_noise_floor(
            replace(fitted, noise=noise), observations, fitted.model, fitted.estimate
        )
        for noise in (fitted.noise, measured)
    )
    return by_sensor / by_both


def summarize_errors_by_range(
    errors: Mapping[str, PositionErrors], outside: np.ndarray
) -> dict[str, Any]:
    """Summarize errors inside and outside the range of the fitted poses.

    Parameters
    ----------
    errors : mapping from stage to PositionErrors of the same observations
    outside : (P,) bool array, as `transfer.find_extrapolated_poses` returns it

    Returns
    -------
    dict
        ``poses``: number of poses outside. ``inside``, ``outside``: the summary of each
        stage, or None if there is no such pose.
    """
    summaries: dict[str, Any] = {"poses": int(outside.sum())}
    for name, poses in (("inside", ~outside), ("outside", outside)):
        summaries[name] = None
        if poses.any():
            summaries[name] = {
                stage: summarize_errors(of_stage.distance[poses[of_stage.cluster]])
                for stage, of_stage in errors.items()
            } or None
    return summaries


def refit_without_folds(
    fitted: Fit, observations: Observations, fold: np.ndarray
) -> Iterator[Estimate]:
    """Refit a model without each fold of the observations in turn.

    The result is that of a fit from the nominal robot with the same shapes.

    Parameters
    ----------
    fitted : Fit
    observations : Observations that it was fitted to, or some of them
    fold : (S,) int array, fold of each state, whole poses in each

    Yields
    ------
    Estimate of the fit to the other folds, for all observations: the frame of a session
    that was left out is fitted to itself, see `place_unseen_sessions`
    """
    model = fitted.model
    noise = fitted.noise
    if len(observations) < len(fitted.weights):
        fitted = fit_model(
            model,
            observations,
            noise,
            fitted.estimate,
            reweight_first_step=True,
            tolerance=INTERMEDIATE_TOLERANCE,
        )
    for number in np.unique(fold):
        training = select_states(observations, fold != number)
        refit = fit_model(
            model, training, noise, fitted.estimate, reweight_first_step=True
        )
        # A parameter that only this fold identifies has its value on the nominal robot.
        newly_unidentifiable = refit.unidentifiable & ~fitted.unidentifiable
        if newly_unidentifiable.any() or not refit.converged:
            start = replace(
                register_placement(model, training), shapes=fitted.estimate.shapes
            )
            refit = fit_model(model, training, noise, start)
        yield place_unseen_sessions(refit, observations)


def predict_left_out_residuals(
    fitted: Fit, observations: Observations, group: np.ndarray
) -> np.ndarray:
    """Predict groups of observations from all other observations.

    By a single step in closed form; parameters that only the left-out group determines
    stay as they are.

    Parameters
    ----------
    fitted : Fit
    observations : Observations that it was fitted to
    group : (M,) int array, group of each observation, 0 .. G-1

    Returns
    -------
    (M, rows) array, measured minus predicted, m and rad, base axes
    """
    covariance_root = factor_covariance(fitted.covariance)
    gram, gradient = _sum_by_group(fitted, observations, group, covariance_root)
    changes = map(_solve_without, gram, gradient)
    steps = np.array([covariance_root @ change for change in changes])
    left_out = fitted.residual.copy()
    # The sensitivities are computed once more, because those of all observations of a
    # large campaign need more memory than the Gram matrices of all groups.
    for indices, plain, _ in fitted.iterate_sensitivities(observations):
        left_out[indices] += (plain @ steps[group[indices], :, None])[..., 0]
    return left_out


def _sum_by_group(
    fitted: Fit,
    observations: Observations,
    group: np.ndarray,
    covariance_root: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Sum the products of whitened sensitivities over each of G groups, for P parameters
    in units of a root of their covariance.

    Returns
    -------
    gram : (G, P, P), products with each other
    gradient : (G, P), products with the whitened residual
    """
    residual = fitted.whiten(fitted.residual)
    parameters = len(covariance_root)
    gram = np.zeros((group.max() + 1, parameters, parameters))
    gradient = np.zeros((len(gram), parameters))
    for indices, _, whitened in fitted.iterate_sensitivities(observations):
        scaled = whitened @ covariance_root
        for number in np.unique(group[indices]).tolist():
            members = group[indices] == number
            of_group = residual[indices][members].ravel()
            rows = scaled[members].reshape(of_group.size, parameters)
            gram[number] += rows.T @ rows
            gradient[number] += rows.T @ of_group
    return gram, gradient


def _solve_without(gram: np.ndarray, gradient: np.ndarray) -> np.ndarray:
    """Change of parameters when rows leave a fit, in coordinates in which the parameter
    covariance is the unit matrix.

    With V S V' the Gram matrix of the sensitivities to these rows (P, P), and g their
    products with the residual (P,), it is V / (1 - S) V' g; zero along what no other
    row determines.
    """
    shares, axes = np.linalg.eigh(gram)
    share_of_others = 1.0 - shares
    is_determined = share_of_others > _SHARE_ROUNDING
    along_axes = np.where(is_determined, axes.T @ gradient, 0.0)
    along_axes /= np.where(is_determined, share_of_others, 1.0)
    change: np.ndarray = axes @ along_axes
    return change
