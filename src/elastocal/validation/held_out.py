"""Errors on poses that no step has seen: before and after, with intervals over poses;
and those on poses left out of a fit.

One Gauss-Newton step from the fit to all observations leads to the fit without a part
(Cook and Weisberg, Residuals and Influence in Regression, 2.2, 1982). Where the errors
of a few poses decide, it is taken as it is, in closed form; where a refit is asked for,
exact residuals after the step prove it, or lead on from there. What a parameter was is
not carried over where only that part identifies it: it goes back to where a fit starts,
to its prior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from elastocal.campaigns.holdout import number_configurations
from elastocal.fitting.least_squares import (
    INTERMEDIATE_TOLERANCE,
    fit_model,
    register_placement,
)
from elastocal.fitting.linearization import linearize_coordinates
from elastocal.fitting.model import compute_residuals, evaluate_conditions
from elastocal.fitting.observations import index_poses, select_states, split_into_blocks
from elastocal.validation.transfer import place_unseen_sessions

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from elastocal.fitting.least_squares import Fit
    from elastocal.fitting.model import Estimate, Model
    from elastocal.fitting.observations import Observations

METRICS = ("mean_m", "rms_m", "p95_m", "max_m")
_CONFIDENCE = 0.95
_ENDS = np.array([0.5 * (1.0 - _CONFIDENCE), 0.5 * (1.0 + _CONFIDENCE)])
# Student's t with the same standard error takes over where few poses make the
# bootstrap-t erratic (3: it holds 80 %, t 94 %; 6: both hold the same), and where so
# many make both alike (300: widths differ by 3 %) and drawing costly.
_FEWEST_TO_DRAW = 6
_MOST_TO_DRAW = 300
# Standard errors that an interval reaches at most: those of Student's t with two
# degrees of freedom. Where one pose makes most of the error, replicates without it
# reach arbitrarily far; in the simulations this costs no coverage (3 degrees: 2 %).
_DEGREES_AT_LEAST = 2
# Standard errors of a logarithm below this are rounding.
_ROUNDING = 1e-12
# What a pose alone determines, such as the frame of a session of one pose, is no error
# of it: shares below are rounding.
_SHARE = 1e-9


@dataclass(frozen=True)
class PositionErrors:
    """Position errors of observations.

    `distance` (M,): m. `cluster` (M,): pose of each, 0 .. P-1.
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
    """Distances between measured and predicted positions."""
    return PositionErrors(
        np.linalg.norm(
            compute_position_residuals(model, estimate, observations), axis=1
        ),
        observations.cluster,
    )


def compute_position_residuals(
    model: Model, estimate: Estimate, observations: Observations
) -> np.ndarray:
    """Measured less predicted positions, ndarray (M, 3): m, base axes; in parts that
    fit into memory."""
    parts = [part for _, _, part in split_into_blocks(observations, 0)]
    return np.concatenate(
        [
            compute_residuals(
                model, estimate, p, evaluate_conditions(model, estimate, p.states)
            )[:, :3]
            for p in parts
        ]
    )


def summarize_errors(distance: np.ndarray) -> dict[str, float]:
    """Mean, RMS, 95th percentile and maximum of distances (M,)."""
    found = (
        distance.mean(),
        np.sqrt((distance**2).mean()),
        np.quantile(distance, 0.95),
        distance.max(),
    )
    return dict(zip(METRICS, map(float, found), strict=True))


@dataclass(frozen=True)
class Reduction:
    """Share by which the RMS falls from one model to another on the same poses.

    `low`, `high`: 95 % interval.
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
    """95 % intervals of the summary, for as few poses as a campaign holds out.

    Measurements of one pose share errors. Mean and RMS, and the ratio of two RMS, have
    bootstrap-t intervals over poses, studentized by the delete-one-pose jackknife on
    the logarithmic scale (Efron and Tibshirani, An Introduction to the Bootstrap, 11.3
    and 12.5; for clusters Cameron, Gelbach and Miller 2008), and those of Student's t
    with the same standard error where poses are very few or many. Quantiles of so few
    poses have none. What they cover: docs/held_out_intervals.md.

    `errors`: of several models for the same observations; every replicate draws the
    same poses for all. `reference`: which of them the reductions count from. Returns
    `intervals`, (2,) for each of `errors` and metric, m, not a number where there is
    none, as with a single pose; `reductions`, from the reference to each.
    """
    cluster = errors[0].cluster
    poses = errors[0].poses
    weights = None
    if _FEWEST_TO_DRAW <= poses <= _MOST_TO_DRAW:
        weights = stream.multinomial(
            poses, np.full(poses, 1.0 / poses), replicates
        ).astype(float)
        # A replicate of one pose alone has no standard error.
        weights = weights[(weights > 0).sum(axis=1) > 1]
    counts = np.bincount(cluster).astype(float)
    none = np.full(2, np.nan)
    squares = [np.bincount(cluster, one.distance**2) for one in errors]
    found = []
    for one, square in zip(errors, squares, strict=True):
        mean = np.exp(
            _log_ratio_interval(np.bincount(cluster, one.distance), counts, weights)[0]
        )
        rms = np.exp(0.5 * _log_ratio_interval(square, counts, weights)[0])
        found.append({"mean_m": mean, "rms_m": rms, "p95_m": none, "max_m": none})
    reductions = []
    before = squares[reference]
    for square in squares:
        interval, error = _log_ratio_interval(square, before, weights)
        high, low = 1.0 - np.exp(0.5 * interval)
        reductions.append(
            Reduction(
                float(low),
                float(high),
                float(0.5 * np.sqrt(square.sum() / before.sum()) * error),
            )
        )
    return found, reductions


def _log_ratio_interval(
    over: np.ndarray, under: np.ndarray, weights: np.ndarray | None
) -> tuple[np.ndarray, float]:
    """Interval (2,) of the logarithm of a ratio of totals over poses, and its standard
    error.

    `over`, `under` (P,): of each pose. `weights` (B, P): how often each counts in each
    replicate; Student's t without.
    """
    poses = len(over)
    if poses < 2:
        return np.full(2, np.nan), np.nan
    value, error = (found[0] for found in _log_ratios(np.ones((1, poses)), over, under))
    if error <= _ROUNDING:
        return np.full(2, value), 0.0
    if weights is None:
        return value + error * stdtrit(poses - 1, _ENDS), error
    drawn, errors = _log_ratios(weights, over, under)
    scattered = errors > _ROUNDING
    pivots = (drawn - value)[scattered] / errors[scattered]
    farthest = stdtrit(_DEGREES_AT_LEAST, _ENDS[1])
    return value - error * np.quantile(pivots, _ENDS[::-1]).clip(
        -farthest, farthest
    ), error


def _log_ratios(
    weights: np.ndarray, over: np.ndarray, under: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms of the ratio of weighted totals, and their jackknife standard errors,
    ndarray (B,) each."""
    poses = len(over)
    tops = weights @ over
    bottoms = weights @ under
    # A pose that was not drawn cannot be left out.
    left = np.log(
        np.where(weights > 0, (tops[:, None] - over) / (bottoms[:, None] - under), 1.0)
    )
    middle = (weights * left).sum(axis=1) / poses
    variance = (
        (poses - 1) / poses * (weights * (left - middle[:, None]) ** 2).sum(axis=1)
    )
    return np.log(tops / bottoms), np.sqrt(variance)


def bound_share_below_maximum(poses: int) -> float:
    """Share of all poses whose errors stay below the largest of so many, at 95 %
    confidence, whatever their distribution.

    The one-sided tolerance limit of a sample's maximum (Wilks, Annals of Mathematical
    Statistics 12, 1941).
    """
    return float((1.0 - _CONFIDENCE) ** (1.0 / poses))


def compute_noise_floor(
    fitted: Fit, observations: Observations, model: Model, estimate: Estimate
) -> float:
    """RMS position error that the noise of a fit alone leaves in observations, m; not a
    number where it is not known."""
    noise = fitted.noise
    total = 0.0
    if noise.source == "residual":
        return float("nan")
    for _, _, part in split_into_blocks(observations, len(fitted.unidentifiable)):
        variance = np.full((len(part), 3), noise.position_m**2)
        if noise.joint_rad.any():
            line = linearize_coordinates(
                model, estimate, part, evaluate_conditions(model, estimate, part.states)
            )
            variance += ((line.joint_jacobian[:, :3] * noise.joint_rad) ** 2).sum(
                axis=2
            )
        total += (variance.sum(axis=1) / part.states.repeats[part.state]).sum()
    return float(np.sqrt(total / len(observations)))


def summarize_errors_by_range(
    errors: Mapping[str, PositionErrors], outside: np.ndarray
) -> dict[str, Any]:
    """Errors before and after, inside and outside the range of the fitted poses.

    `errors`: by stage, for the same observations. `outside` (P,) of bool: as of
    `placing.outside_poses`. Returns ``poses`` outside, and summaries of every stage
    ``inside`` and ``outside``, None where there is no such pose.
    """
    found: dict[str, Any] = {"poses": int(outside.sum())}
    for name, poses in (("inside", ~outside), ("outside", outside)):
        there = errors if poses.any() else {}
        found[name] = {
            stage: summarize_errors(one.distance[poses[one.cluster]])
            for stage, one in there.items()
        } or None
    return found


def refit_without_folds(
    fitted: Fit, observations: Observations, part: np.ndarray
) -> Iterator[Estimate]:
    """Fit a model without each part of the observations in turn, as a fit from the
    nominal robot would with the same shapes.

    `observations`: which it was fitted to, or some of them. `part` (S,) of int: of each
    state, by whole poses. Yields the fit to the rest, for all observations: a session
    that was left out has its frame fitted to itself, see `placed_estimate`.
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
    for number in np.unique(part):
        rest = select_states(observations, part != number)
        refit = fit_model(model, rest, noise, fitted.estimate, reweight_first_step=True)
        # What only that part identifies is where the nominal robot has it.
        if (refit.unidentifiable & ~fitted.unidentifiable).any() or not refit.converged:
            refit = fit_model(
                model,
                rest,
                noise,
                replace(register_placement(model, rest), shapes=fitted.estimate.shapes),
            )
        yield place_unseen_sessions(refit, observations)


def predict_left_out_squares(fitted: Fit, observations: Observations) -> np.ndarray:
    """Mean square position error of each configuration as all others predict it, m²,
    ndarray (configurations,).

    By the step alone, in closed form, with what is held as in the fit.
    """
    white = fitted.whiten(fitted.residual)
    states = observations.states
    found = []
    configuration = number_configurations(states.joint_angles, index_poses(states))[
        observations.cluster
    ]
    plain, whitened = (
        np.concatenate(parts)
        for parts in list(
            zip(*fitted.iterate_sensitivities(observations), strict=True)
        )[1:]
    )
    for number in range(configuration.max() + 1):
        mine = configuration == number
        rows = whitened[mine].reshape(
            mine.sum() * whitened.shape[1], len(fitted.unidentifiable)
        )
        gain = fitted.covariance @ rows.T
        inverse = np.linalg.pinv(
            np.eye(len(rows)) - rows @ gain, rcond=_SHARE, hermitian=True
        )
        moved = plain[mine][:, :3] @ (gain @ (inverse @ white[mine].ravel()))
        found.append(((fitted.residual[mine][:, :3] + moved) ** 2).sum(axis=1).mean())
    return np.array(found)
