"""Verification of a corrected robot: it was commanded to corrected targets, and a
tracker measured where it came to rest.

The measured error at a target is the measured position less the wanted one. Where the
base frame or the offset of the reflector is unknown, both are fitted to the measured
targets first, because the tracker may stand elsewhere than in the campaign.

Three questions are answered:

- Did the prediction hold? The mean squared error is compared with those of robots that
  the fit of the campaign does not rule out, each with new noise of the tracker: a
  posterior predictive check [1].
- Which RMS error does the robot have at targets like the measured ones? Its mean square
  is the measured one less that of the tracker's noise, with the sampling distribution of
  a variance estimate whose degrees of freedom follow from the scatter between
  configurations [2]. `validation.conformity` compares it with a tolerance.
- Does an error remain that repeats? The mean squared error is compared with that of the
  noise and the repeatability alone.

[1] Gelman, A., Meng, X.-L. and Stern, H., Posterior predictive assessment of model
fitness via realized discrepancies, Statistica Sinica 6, 1996.
[2] Satterthwaite, F. E., An approximate distribution of estimates of variance
components, Biometrics Bulletin 2, 1946.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.stats import chi, ncx2

from elastocal.application.accuracy import CONFIDENCE, predict_errors
from elastocal.application.calibrated import compute_pose_sensitivities, predict_poses
from elastocal.application.frames import (
    BASE,
    ROBOT,
    Scope,
    compute_placement_columns,
    fit_placement,
    select_free_parameters,
)
from elastocal.exchange.measured_targets import CorrectedTargets
from elastocal.mechanics.kinematics import align_points
from elastocal.validation.conformity import MIN_CONFIGURATIONS

if TYPE_CHECKING:
    from elastocal.application.accuracy import ErrorPrediction
    from elastocal.application.calibrated import CalibratedRobot

# Level of both tests: the share of correct predictions that are rejected, and of exact
# corrections that are called incomplete, by chance.
LEVEL = 0.05
# Power of the test for the additional error that is stated.
POWER = 0.8
# A placement that is fitted to the targets uses up to nine degrees of freedom. With twelve
# targets, the residual has at least three times as many.
FEWEST_PLACED_TARGETS = 12
_DRAWS = 4000
# Share of draws that must be possible. A correctly stated noise leaves fewer in one
# verification in twenty of a robot without any error.
_FEWEST_POSSIBLE = 0.05
_SEED = 1
# Gauss-Newton steps of the placement; each squares the remaining error, and the first
# placement is off by no more than the offset of the reflector over the workspace.
_PLACEMENT_STEPS = 12
# Smallest noise of a coordinate, m, far below that of any tracker; without noise the
# ratio of error to noise is not defined.
_SMALLEST_NOISE_M = 1e-9


@dataclass(frozen=True)
class CommandedTargets(CorrectedTargets):
    """Corrected targets to which a robot was commanded, N of them, all measured.

    Attributes
    ----------
    number : (N,) int, row in the table of targets, from 1.
    measured : (N, 3) measured positions of the reflector, m, in the tracker's frame.
    repeats : (N,) int, number of measurements of which each is the mean.
    configuration : (N,) int, configuration of each target, 0 .. C-1.
    """

    number: np.ndarray
    measured: np.ndarray
    repeats: np.ndarray
    configuration: np.ndarray


@dataclass(frozen=True)
class MeasuredErrors:
    """Measured position errors of N targets.

    Attributes
    ----------
    error : (N, 3) m, measured less wanted position of the reflector, base axes.
    free : (12,) bool, parameters of the placement that were fitted to the targets.
    fitted : number of independent parameters among them.
    """

    error: np.ndarray
    free: np.ndarray
    fitted: int

    @property
    def distance_m(self) -> np.ndarray:
        """(N,) lengths of the errors."""
        return np.linalg.norm(self.error, axis=1)

    @property
    def degrees_of_freedom(self) -> int:
        """Number of coordinates less that of the fitted parameters."""
        return self.error.size - self.fitted

    def compute_rms_without_noise_m(self, sensor_m: np.ndarray) -> float:
        """Compute the RMS error without the noise of the tracker, m; `sensor_m` (N,) is
        its standard deviation in a coordinate."""
        by_noise = 3.0 * float((sensor_m**2).mean())
        return float(np.sqrt(max(self.mean_square - by_noise, 0.0)))

    @property
    def mean_square(self) -> float:
        """Mean squared error, m^2, without a loss by the fitted placement."""
        return 3.0 * float((self.error**2).sum()) / self.degrees_of_freedom


@dataclass(frozen=True)
class PredictionTest:
    """Whether the measured errors are those that were predicted.

    Attributes
    ----------
    held : whether the p-value is at least `level`.
    p_value : probability of a measured RMS error at least as large as this one if the
        prediction is right.
    level : significance level.
    expected_m : RMS error that the prediction and the tracker's noise let expect.
    noticed_m : RMS error of the robot that this test notices with the probability
        `power`.
    power : see there.
    above_bound : number of targets whose error exceeds their bound with the noise.
    bounded : number of targets with a bound.
    """

    held: bool
    p_value: float
    level: float
    expected_m: float
    noticed_m: float
    power: float
    above_bound: int
    bounded: int


@dataclass(frozen=True)
class RemainingError:
    """Whether an error remains that repeats.

    Attributes
    ----------
    remains : whether the p-value is below `level`.
    p_value : probability of a measured RMS error at least as large as this one if there
        is only noise and repeatability.
    level : significance level.
    rms_m : RMS error beyond noise and repeatability.
    chance_m : RMS error by noise and repeatability alone.
    """

    remains: bool
    p_value: float
    level: float
    rms_m: float
    chance_m: float


def compute_measured_errors(
    targets: CommandedTargets,
    offset_m: tuple[float, ...] | None,
    *,
    base_known: bool,
) -> MeasuredErrors:
    """Compute the errors of measured targets, after the best placement of what is
    unknown.

    Parameters
    ----------
    targets : the targets.
    offset_m : offset of the reflector in the frame of the end effector's measuring
        point; None if it is unknown and fitted.
    base_known : whether positions were measured in the base frame. Else the placement of
        the base is fitted: the best rotation and shift of the measured positions [1],
        improved by Gauss-Newton steps together with the offset.

    References
    ----------
    .. [1] Kabsch, W., A solution for the best rotation to relate two sets of vectors,
       Acta Crystallographica A32, 1976.
    """
    free = select_free_parameters(base=not base_known, offset=offset_m is None)
    offset = np.zeros(3) if offset_m is None else np.array(offset_m)
    wanted = targets.position + targets.rotation @ offset
    measured = targets.measured
    if not base_known:
        rotation, shift = align_points(measured, wanted)
        measured = measured @ rotation.T + shift
    if not free.any():
        return MeasuredErrors(measured - wanted, free, 0)
    scope = Scope(ROBOT, wanted.mean(axis=0))
    columns = compute_placement_columns(scope, targets.position, targets.rotation)
    for _ in range(_PLACEMENT_STEPS):
        difference = wanted - measured
        field = np.concatenate([difference, np.zeros_like(difference)], axis=1)
        step = fit_placement(columns, field[..., None], free)[:, 0]
        turn = Rotation.from_rotvec(step[3:6]).as_matrix()
        measured = (measured - scope.origin) @ turn.T + scope.origin + step[:3]
        wanted = wanted - targets.rotation @ step[6:9]
    design = columns[:, :3, free].reshape(3 * len(targets), -1)
    fitted = int(np.linalg.matrix_rank(design))
    return MeasuredErrors(measured - wanted, free, fitted)


def place_over_targets(
    calibrated: CalibratedRobot, targets: CommandedTargets, free: np.ndarray
) -> CalibratedRobot:
    """Return the robot whose predicted errors are those after the best placement over
    the targets, as the measured errors are.

    `free` are the parameters of the placement, (12,) bool.
    """
    if not free.any():
        return calibrated
    scope = replace(calibrated.scope, origin=targets.position.mean(axis=0))
    commands = targets.joint_angles, targets.wrench
    columns = compute_placement_columns(scope, *predict_poses(calibrated, *commands))
    sensitivities = compute_pose_sensitivities(calibrated, *commands)
    absorbed = fit_placement(columns, sensitivities, free)
    return replace(calibrated, scope=replace(scope, absorbed=absorbed))


def check_prediction(
    errors: MeasuredErrors,
    predicted_rms_m: np.ndarray,
    bound_m: np.ndarray,
    sensor_m: np.ndarray,
) -> PredictionTest:
    """Test whether the measured errors are as large as predicted, or smaller.

    Parameters
    ----------
    errors : measured errors of N targets.
    predicted_rms_m : (draws,) RMS errors over the targets of robots that the fit does
        not rule out, after the placement that was fitted to the targets.
    bound_m : (N,) upper bounds of single errors, m; NaN where there is none.
    sensor_m : (N,) standard deviation of the tracker's noise in a coordinate.
    """
    stream = np.random.default_rng(_SEED)
    count = len(sensor_m)
    noise_m = max(float(np.sqrt((sensor_m**2).mean())), _SMALLEST_NOISE_M)
    dof = errors.degrees_of_freedom
    ratios = count * (predicted_rms_m / noise_m) ** 2
    drawn = stream.noncentral_chisquare(dof, ratios)
    observed = float((errors.error**2).sum()) / noise_m**2
    p_value = float((1 + (drawn >= observed).sum()) / (1 + len(drawn)))
    critical = float(np.quantile(drawn, 1.0 - LEVEL))
    noticed = _find_noncentrality(critical, dof)
    has_bound = np.isfinite(bound_m)
    allowed_m = add_noise_to_bound(bound_m, sensor_m)
    return PredictionTest(
        p_value >= LEVEL,
        p_value,
        LEVEL,
        noise_m * float(np.sqrt(drawn.mean() / count)),
        noise_m * float(np.sqrt(noticed / count)),
        POWER,
        int((errors.distance_m > allowed_m)[has_bound].sum()),
        int(has_bound.sum()),
    )


def add_noise_to_bound(bound_m: np.ndarray, sensor_m: np.ndarray) -> np.ndarray:
    """Return the upper bounds (N,) of measured errors, m, from those of the errors of the
    robot and the noise in a coordinate. They have the same confidence, exactly so for
    isotropic normal errors."""
    return np.hypot(bound_m, chi.ppf(CONFIDENCE, 3) * sensor_m)


def _find_noncentrality(critical: float, dof: int) -> float:
    """Find the noncentrality of the chi-square distribution that exceeds a critical
    value with the probability `POWER`."""

    def excess(noncentrality: float) -> float:
        return float(ncx2.sf(critical, dof, noncentrality)) - POWER

    if excess(1e-9) >= 0.0:
        return 0.0
    return float(brentq(excess, 1e-9, 4.0 * critical + 100.0))


def find_remaining_error(
    errors: MeasuredErrors,
    repeated_m: np.ndarray,
    sensor_m: np.ndarray,
    noise_dof: int,
) -> RemainingError:
    """Test whether more than noise and repeatability remains of the errors.

    The noise was estimated from few repeats, so that it may be larger than estimated.
    Without this uncertainty, the test would find an error that repeats in far more than
    5 % of the robots that have none.

    Parameters
    ----------
    errors : measured errors of N targets.
    repeated_m : (N,) RMS error of a target by the repeatability of the joints.
    sensor_m : (N,) standard deviation of the tracker's noise in a coordinate.
    noise_dof : as of `draw_measured_rms`.
    """
    stream = np.random.default_rng(_SEED)
    variance = sensor_m**2 + repeated_m**2 / 3.0
    share = errors.degrees_of_freedom / errors.error.size
    drawn = stream.chisquare(3, (_DRAWS, len(variance))) @ variance * share
    drawn *= _draw_noise_scale(stream, noise_dof)
    observed = float((errors.error**2).sum())
    p_value = float((1 + (drawn >= observed).sum()) / (1 + _DRAWS))
    by_chance = 3.0 * float(variance.mean())
    beyond = max(errors.mean_square - by_chance, 0.0)
    return RemainingError(
        p_value < LEVEL,
        p_value,
        LEVEL,
        float(np.sqrt(beyond)),
        float(np.sqrt(by_chance)),
    )


def _draw_noise_scale(stream: np.random.Generator, noise_dof: int) -> np.ndarray:
    """Draw ratios (draws,) of the noise's variance to its estimate with `noise_dof`
    degrees of freedom; ones if the noise is declared."""
    if not noise_dof:
        return np.ones(_DRAWS)
    return noise_dof / stream.chisquare(noise_dof, _DRAWS)


def draw_measured_rms(
    errors: MeasuredErrors,
    configuration: np.ndarray,
    sensor_m: np.ndarray,
    noise_dof: int,
) -> np.ndarray:
    """Draw RMS errors of the robot at targets like the measured ones, (draws,), m.

    Only draws whose mean square is positive without the noise are possible. If they are
    too rare, the noise is overstated, and nothing is subtracted.

    The uncertainty is that of the tracker's noise and of the number of targets. Errors
    of one configuration are taken as dependent, those of different ones as independent.
    The scatter between few configurations may be small by chance; it counts as at least
    that of normally distributed errors.

    Parameters
    ----------
    errors : measured errors of N targets.
    configuration : (N,) int, configuration of each target, 0 .. C-1.
    sensor_m : (N,) standard deviation of the tracker's noise in a coordinate; 0 if the
        noise is unknown, so that nothing is subtracted.
    noise_dof : degrees of freedom of the estimate of the noise; 0 if it is declared.
    """
    stream = np.random.default_rng(_SEED)
    count = len(sensor_m)
    by_noise = 3.0 * float((sensor_m**2).mean())
    total = errors.mean_square
    of_robot = max(total - by_noise, 0.0)
    configurations = int(configuration.max()) + 1
    normal = (2.0 / 3.0) * (
        of_robot**2 / configurations + by_noise * (by_noise + 2.0 * of_robot) / count
    )
    variance = max(normal, _compute_ratio_variance(errors, configuration))
    # Errors far below the noise would have hardly any degree of freedom.
    dof = max(2.0 * total**2 / variance, 1.0) if variance else np.inf
    scale = np.ones(_DRAWS)
    if np.isfinite(dof):
        scale = dof / stream.chisquare(dof, _DRAWS)
    noise_scale = _draw_noise_scale(stream, noise_dof)
    mean_square = total * scale - by_noise * noise_scale
    is_possible = mean_square > 0.0
    if is_possible.mean() < _FEWEST_POSSIBLE:
        return np.sqrt(total * scale)
    return np.sqrt(mean_square[is_possible])


def _compute_ratio_variance(errors: MeasuredErrors, configuration: np.ndarray) -> float:
    """Estimate the variance of the mean squared error, m^4, from the scatter between
    configurations: that of a ratio of two totals over clusters."""
    sizes = np.bincount(configuration).astype(float)
    clusters = len(sizes)
    if clusters < 2:
        return 0.0
    totals = np.bincount(configuration, errors.distance_m**2)
    deviation = totals - sizes * totals.sum() / sizes.sum()
    return float(clusters / (clusters - 1.0) * (deviation**2).sum() / sizes.sum() ** 2)


def list_verification_shortfalls(
    targets: CommandedTargets, errors: MeasuredErrors
) -> list[str]:
    """List why the measured targets are too few to pass a tolerance."""
    shortfalls = []
    configurations = int(targets.configuration.max()) + 1
    if configurations < MIN_CONFIGURATIONS:
        shortfalls.append(
            f"{configurations} measured configurations, where at least"
            f" {MIN_CONFIGURATIONS} must judge"
        )
    if errors.fitted and len(targets) < FEWEST_PLACED_TARGETS:
        shortfalls.append(
            f"{len(targets)} measured targets, where at least {FEWEST_PLACED_TARGETS}"
            " must determine a placement and judge"
        )
    return shortfalls


def predict_over_targets(
    calibrated: CalibratedRobot, targets: CommandedTargets, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Predict the RMS errors over the targets after the placement that was fitted to
    them, (draws,), and the error of each target by the repeatability, (N,), m."""
    placed = place_over_targets(calibrated, targets, free)
    prediction = predict_errors(placed, targets.joint_angles, targets.wrench)
    return prediction.rms_m, prediction.repeated_m


@dataclass(frozen=True)
class TargetComparison:
    """Measured and predicted errors of commanded targets.

    Attributes
    ----------
    calibrated : the robot.
    targets : the targets.
    errors : measured errors.
    sensor_m : (N,) standard deviation of the tracker's noise in a coordinate.
    subtracted_m : (N,) the same, or 0 if it is only known from the residual of the fit.
    now : predicted errors by the present diagnosis, in the frame of the campaign.
    prediction, remaining : results of the tests.
    measured_rms_m : (draws,) RMS errors of the robot at targets like these.
    """

    calibrated: CalibratedRobot
    targets: CommandedTargets
    errors: MeasuredErrors
    sensor_m: np.ndarray
    subtracted_m: np.ndarray
    now: ErrorPrediction
    prediction: PredictionTest
    remaining: RemainingError
    measured_rms_m: np.ndarray


def compare_targets(
    calibrated: CalibratedRobot,
    targets: CommandedTargets,
    offset_m: tuple[float, ...] | None,
) -> TargetComparison:
    """Compare measured with predicted errors; `offset_m` is as in
    `compute_measured_errors`."""
    noise = calibrated.noise
    base_known = calibrated.scope.frame == BASE
    errors = compute_measured_errors(targets, offset_m, base_known=base_known)
    sensor_m = noise.position_m / np.sqrt(targets.repeats)
    # A noise that is only known from the residual contains errors of the robot.
    subtracted_m = sensor_m if noise.source != "residual" else 0.0 * sensor_m
    predicted_rms_m, repeated_m = predict_over_targets(calibrated, targets, errors.free)
    return TargetComparison(
        calibrated,
        targets,
        errors,
        sensor_m,
        subtracted_m,
        predict_errors(calibrated, targets.joint_angles, targets.wrench),
        check_prediction(errors, predicted_rms_m, targets.bound_m, sensor_m),
        find_remaining_error(errors, repeated_m, sensor_m, noise.degrees_of_freedom),
        draw_measured_rms(
            errors, targets.configuration, subtracted_m, noise.degrees_of_freedom
        ),
    )
