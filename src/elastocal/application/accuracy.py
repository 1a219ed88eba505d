"""The accuracy of a robot that is commanded by its calibrated model, defined once for
all commands.

The error at a pose is the pose of the real robot less that of the commanded model, in a
frame of `frames`. The predicted error has four parts:

- the uncertainty of the fitted parameters;
- the repeatability of the joints and the random error of each new pose;
- the uncertainty about the form of the model: differences between the models of the
  diagnosis, or held-out poses if these show more;
- all that the fit ascribes to effects that no command contains, such as hysteresis or a
  step of the set-up, because nothing shows that they leave the robot alone: at each
  pose, under all conditions that no command states (`left_out`).

If a regression on the residuals corrects a pose, the first two parts are at least as
large as its cross-validated errors, and these contain the uncertainty about the form
unless held-out poses show more. The tracker's noise is in none of the parts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammainc, gammaincinv

from elastocal.application.calibrated import (
    build_states,
    compute_pose_sensitivities,
    predict_poses,
    select_regression_inputs,
    split_into_chunks,
)
from elastocal.application.frames import (
    Scope,
    compute_placement_columns,
    root_mean_square,
)
from elastocal.application.scope import set_form_error
from elastocal.fitting.covariance import factor_covariance
from elastocal.fitting.least_squares import IDENTIFIED_SHARE
from elastocal.fitting.model import list_parameters
from elastocal.mechanics.kinematics import compute_jacobians
from elastocal.verdict import Accuracy

if TYPE_CHECKING:
    from collections.abc import Iterator

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.fitting.model import Case

REGION = "the poses and loads that were fitted"
# One-sided confidence of every bound, as in GUM and JCGM 106. Held-out poses must reach
# the same confidence before they raise a prediction, so that this happens by chance to
# one correctly predicted campaign in twenty.
CONFIDENCE = 0.95
# Number of simulated robots; it determines a risk of 5 % to half a percent.
DRAWS = 2000
_SEED = 1
# Ratio of the squared model-form error at the worst pose to its mean square. It is 7 to
# 9 on simulated robots.
_WORST_OF_FORM = 9.0
# Least variance of a squared length over the square of its mean: a length of a hundredth
# more or less.
_MIN_RELATIVE_VARIANCE = 1e-4
# Bisections of the range of a quantile, to a thousandth of it.
_BISECTIONS = 10
# Poses for which the errors of all simulated robots are in memory at once.
_CHUNK = 200
# Number of chunks of poses with new random numbers for the repeatability. Further chunks
# reuse those of the last one for other robots, because drawing takes most of the time of
# a long path. No robot gets the same number twice.
_DRAWN_CHUNKS = 5
# Upper bound on the states over which the accuracy of a campaign is stated, and that of
# held-out poses predicted; more states do not change a printed digit.
_MOST_STATES = 1000


@dataclass(frozen=True)
class ErrorPrediction:
    """Predicted errors at N poses.

    Attributes
    ----------
    parameters_m : (N,) RMS error by the uncertainty of the parameters.
    repeated_m : (N,) RMS error by the repeatability and the random error of each pose.
    regression_m : (N,) RMS error of a regression on the residuals beyond both.
    form_m : (N,) RMS error by the uncertain form of the model.
    left_out_m : (N,) RMS error by effects that no command contains.
    error_m : (N,) RMS error by all of these.
    bound_m : (N,) upper bound on each error with `CONFIDENCE`.
    orientation_rad : (N,) RMS orientation error by the parameters and the repeatability.
        Nothing is known of the other parts, which positions alone show.
    rms_m, worst_m : (draws,) RMS and maximum over the poses, for simulated robots that
        the fit does not rule out.
    scope : meaning of the errors.
    """

    parameters_m: np.ndarray
    repeated_m: np.ndarray
    regression_m: np.ndarray
    form_m: np.ndarray
    left_out_m: np.ndarray
    error_m: np.ndarray
    bound_m: np.ndarray
    orientation_rad: np.ndarray
    rms_m: np.ndarray
    worst_m: np.ndarray
    scope: Scope

    def summarize(self, region: str) -> Accuracy:
        """Summarize the errors over all poses; `region` names these in words."""
        scope = self.scope
        return Accuracy(
            frame=scope.frame,
            rms_m=root_mean_square(self.error_m),
            worst_m=root_mean_square(self.worst_m),
            rms_bound_m=float(np.quantile(self.rms_m, CONFIDENCE)),
            worst_bound_m=float(np.quantile(self.worst_m, CONFIDENCE)),
            poses=len(self.error_m),
            region=region,
            offset_removed=scope.offset_removed,
            left_out=scope.left_out,
            left_out_m=root_mean_square(self.left_out_m),
            form_m=root_mean_square(self.form_m),
            contradicted=scope.contradicted,
            repeated_m=root_mean_square(self.repeated_m),
            regression_m=root_mean_square(self.regression_m),
            fitted=bool(self.parameters_m.any()),
        )


def predict_errors(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    draws: int = DRAWS,
) -> ErrorPrediction:
    """Predict the errors of the corrected robot at commanded joint angles under loads.

    Parameters
    ----------
    calibrated : the robot, with its parameter covariance, noise and scope.
    reported_angles : (N, n) commands as the controller reports them, rad.
    wrench : (N, 6) loads, N and N m, as in `calibrated.predict_poses`.
    draws : number of simulated robots. They take most of the time and are needed only
        for errors over all poses; 0 is enough for the errors of each pose.
    """
    scope = calibrated.scope
    regression = _predict_regression_errors(calibrated, reported_angles, wrench)
    robots = _draw_robots(calibrated, draws)
    errors = _merge_chunks(
        [
            _predict_chunk(
                calibrated,
                reported_angles[chunk],
                wrench[chunk],
                regression.select(chunk),
                repeating,
            )
            for chunk, repeating in robots.generate_repeats(len(reported_angles))
        ]
    )
    parameter_variance = np.diagonal(errors.parameter_covariance, axis1=1, axis2=2)
    repeat_variance = np.diagonal(errors.repeat_covariance, axis1=1, axis2=2)
    pose_variance = parameter_variance + repeat_variance
    left_out = errors.left_out.mean_square
    covered = regression.active & (not scope.contradicted)
    form = np.where(covered, 0.0, scope.form_m**2)
    isotropic = ((errors.additional[1] + form) / 3.0)[:, None, None] * np.eye(3)
    # A model-form error is one function over all poses; only its size is unknown.
    drawn_form = form.mean() * robots.stream.standard_normal(draws) ** 2
    mean_square = errors.sum_of_squares / len(reported_angles)
    largest_left_out = (errors.left_out.branches**2).sum(axis=2).max()
    return ErrorPrediction(
        parameters_m=np.sqrt(parameter_variance[:, :3].sum(axis=1)),
        repeated_m=np.sqrt(repeat_variance[:, :3].sum(axis=1)),
        regression_m=np.sqrt(errors.additional[0]),
        form_m=np.sqrt(form),
        left_out_m=np.sqrt(left_out),
        error_m=np.sqrt(
            pose_variance[:, :3].sum(axis=1) + errors.additional[0] + left_out + form
        ),
        bound_m=compute_length_quantiles(
            (errors.parameter_covariance + errors.repeat_covariance)[:, :3, :3]
            + errors.left_out.covariance
            + isotropic,
            errors.left_out.branches,
        ),
        orientation_rad=np.sqrt(pose_variance[:, 3:].sum(axis=1)),
        rms_m=np.sqrt(mean_square + left_out.mean() + drawn_form),
        worst_m=np.sqrt(
            errors.largest_square + largest_left_out + _WORST_OF_FORM * drawn_form
        ),
        scope=scope,
    )


def predict_determined_rms_m(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> np.ndarray:
    """Predict the RMS errors over commands of simulated robots, (draws,), as if all that
    the measurements do not determine were as estimated.

    Arguments as in `predict_errors`.
    """
    determined = replace(
        calibrated, covariance=compute_determined_covariance(calibrated)
    )
    return predict_errors(determined, reported_angles, wrench).rms_m


def compute_determined_covariance(calibrated: CalibratedRobot) -> np.ndarray:
    """Compute the covariance (P, P) of the parameters given those directions of the
    parameters of which their priors say more than the measurements.

    The directions are the principal axes of the covariance in units of the priors [1]
    along which more than `IDENTIFIED_SHARE` of the prior variance is left.

    References
    ----------
    .. [1] Spantini, A. et al., Optimal low-rank approximations of Bayesian linear inverse
       problems, SIAM Journal on Scientific Computing 37, 2015.
    """
    covariance = calibrated.covariance
    parameters = list_parameters(calibrated.model, calibrated.estimate)
    prior_std = np.array([parameter.prior_std or 0.0 for _, parameter in parameters])
    has_prior = prior_std > 0.0
    # Functionals (K, P) of the parameters that are uncorrelated in prior units.
    functionals = np.diag(1.0 / np.where(has_prior, prior_std, 1.0))[has_prior]
    shares, axes = np.linalg.eigh(functionals @ covariance @ functionals.T)
    undetermined = shares > IDENTIFIED_SHARE
    directions = axes[:, undetermined].T @ functionals
    gains = covariance @ directions.T / shares[undetermined]
    return np.asarray(covariance - gains @ (directions @ covariance))


@dataclass(frozen=True)
class _LeftOutErrors:
    """Errors at N poses by effects that no command contains.

    Attributes
    ----------
    branches : (N, K, 3) errors under K conditions, m.
    covariance : (N, 3, 3) covariance of each by the uncertainty of the effects, m^2.
    """

    branches: np.ndarray
    covariance: np.ndarray

    @property
    def mean_square(self) -> np.ndarray:
        """(N,) mean squared lengths, m^2."""
        squares = (self.branches**2).sum(axis=2).mean(axis=1)
        return np.asarray(squares + np.trace(self.covariance, axis1=1, axis2=2))


def _predict_left_out_errors(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    pose: tuple[np.ndarray, np.ndarray],
) -> _LeftOutErrors:
    """Predict the errors by left-out effects at poses that are given, too."""
    scope = calibrated.scope
    if scope.left_out_effects is None:
        count = len(reported_angles)
        return _LeftOutErrors(np.zeros((count, 1, 3)), np.zeros((count, 3, 3)))
    states = build_states(calibrated, reported_angles, wrench)
    return _LeftOutErrors(
        *scope.left_out_effects.predict_branches(scope, states, *pose)
    )


@dataclass(frozen=True)
class _RegressionErrors:
    """Cross-validated errors of a regression on the residuals at N poses.

    Attributes
    ----------
    active : (N,) bool, poses that the regression corrects.
    squares : (2, N) squared errors without the tracker's noise, m^2: mean squares, and
        those that belong to confidence intervals; 0 at all other poses.
    """

    active: np.ndarray
    squares: np.ndarray

    def select(self, chunk: slice) -> _RegressionErrors:
        """Select some of the poses."""
        return _RegressionErrors(self.active[chunk], self.squares[:, chunk])


def _predict_regression_errors(
    calibrated: CalibratedRobot, reported_angles: np.ndarray, wrench: np.ndarray
) -> _RegressionErrors:
    active, inputs = select_regression_inputs(calibrated, reported_angles, wrench)
    squares = np.zeros((2, len(active)))
    residual_model = calibrated.residual_model
    if residual_model is not None and inputs is not None:
        std = residual_model.predictor.std(inputs)
        for row, factor in enumerate((residual_model.typical, 1.0)):
            variance = factor**2 * std**2 - residual_model.sensor_m**2
            squares[row, active] = np.maximum(variance.sum(axis=1), 0.0)
    return _RegressionErrors(active, squares)


@dataclass(frozen=True)
class _RandomRobots:
    """Robots that are drawn from the parameter covariance.

    Attributes
    ----------
    stream : random numbers; each pose takes its repeatability from it.
    covariance_factor : (P, P) factor of the parameter covariance.
    standard_normal : (P, draws) parameters in units of this factor.
    repeatability_scale : (draws,) repeatability of each robot over its estimate.
    joint_std_rad : (n,) standard deviation of each joint, by its repeatability and the
        random error of each pose.
    """

    stream: np.random.Generator
    covariance_factor: np.ndarray
    standard_normal: np.ndarray
    repeatability_scale: np.ndarray
    joint_std_rad: np.ndarray

    def generate_repeats(self, poses: int) -> Iterator[tuple[slice, _RepeatingRobots]]:
        """Generate chunks of a number of poses with the random errors of the joints."""
        draws = len(self.repeatability_scale)
        normals = np.zeros(0)
        for number, chunk in enumerate(split_into_chunks(poses, _CHUNK)):
            size = min(chunk.stop, poses) - chunk.start
            shift = number % max(draws, 1)
            if number < _DRAWN_CHUNKS or shift == 0:
                shape = (size, len(self.joint_std_rad), draws)
                normals = self.stream.standard_normal(shape)
                shift = 0
            yield chunk, _RepeatingRobots(self, normals[:size], shift)


@dataclass(frozen=True)
class _RepeatingRobots:
    """Random robots with the repeatability errors of their joints at a chunk of K poses.

    Attributes
    ----------
    robots : the robots.
    normals : (K, n, draws) standard normal errors of the joints.
    shift : the errors of a robot are those in the column this far behind its own.
    """

    robots: _RandomRobots
    normals: np.ndarray
    shift: int

    def simulate_errors(
        self, by_parameters: np.ndarray, by_repeats: np.ndarray
    ) -> np.ndarray:
        """Simulate position errors (K, 3, draws) from factors (K, 3, P) and (K, 3, n) of
        their covariances. The robots are in the order of the columns of `normals`."""
        errors = by_repeats @ self.normals
        errors *= np.roll(self.robots.repeatability_scale, self.shift)
        # One product of two matrices is faster than one for each pose. The number of rows
        # is given, since a model without parameters leaves nothing to infer it from.
        rows = 3 * len(by_parameters)
        flat = by_parameters.reshape(rows, by_parameters.shape[2])
        parameters = np.roll(self.robots.standard_normal, self.shift, axis=1)
        errors += (flat @ parameters).reshape(errors.shape)
        return errors

    def restore_order(self, of_robots: np.ndarray) -> np.ndarray:
        """Return values (draws,) in the order of the robots."""
        return np.roll(of_robots, -self.shift)


def _draw_robots(calibrated: CalibratedRobot, draws: int) -> _RandomRobots:
    noise = calibrated.noise
    dof = calibrated.scope.repeatability_dof
    factor = factor_covariance(calibrated.covariance)
    stream = np.random.default_rng(_SEED)
    standard_normal = stream.standard_normal((factor.shape[1], draws))
    scale = np.ones(draws)
    if dof:
        scale = np.sqrt(stream.gamma(0.5 * dof, 2.0 / dof, draws))
    joint_std_rad = np.hypot(noise.joint_rad, noise.pose_rad)
    return _RandomRobots(stream, factor, standard_normal, scale, joint_std_rad)


@dataclass(frozen=True)
class _ChunkErrors:
    """Predicted errors at a chunk of K poses.

    Attributes
    ----------
    parameter_covariance, repeat_covariance : (K, 6, 6) covariances of the pose errors.
    additional : (2, K) squared errors of the regression beyond these, m^2, as in
        `_RegressionErrors.squares`.
    left_out : errors by effects that no command contains.
    sum_of_squares, largest_square : (draws,) sum and maximum over the poses of the
        squared position errors of each random robot, m^2.
    """

    parameter_covariance: np.ndarray
    repeat_covariance: np.ndarray
    additional: np.ndarray
    left_out: _LeftOutErrors
    sum_of_squares: np.ndarray
    largest_square: np.ndarray


def _merge_chunks(chunks: list[_ChunkErrors]) -> _ChunkErrors:
    """Join the errors at chunks of poses to those at all poses."""
    sum_of_squares = np.zeros_like(chunks[0].sum_of_squares)
    largest_square = np.zeros_like(chunks[0].largest_square)
    for chunk in chunks:
        sum_of_squares += chunk.sum_of_squares
        largest_square = np.maximum(largest_square, chunk.largest_square)
    return _ChunkErrors(
        np.concatenate([chunk.parameter_covariance for chunk in chunks]),
        np.concatenate([chunk.repeat_covariance for chunk in chunks]),
        np.concatenate([chunk.additional for chunk in chunks], axis=1),
        _LeftOutErrors(
            np.concatenate([chunk.left_out.branches for chunk in chunks]),
            np.concatenate([chunk.left_out.covariance for chunk in chunks]),
        ),
        sum_of_squares,
        largest_square,
    )


def _predict_chunk(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    regression: _RegressionErrors,
    repeating: _RepeatingRobots,
) -> _ChunkErrors:
    """Predict the errors at a chunk of poses, and simulate the errors of random robots."""
    pose = predict_poses(calibrated, reported_angles, wrench)
    placed = _compute_placed_sensitivities(calibrated, reported_angles, wrench, pose)
    robots = repeating.robots
    by_parameters = placed @ robots.covariance_factor
    robot = calibrated.robot
    angles = robot.model_angles(reported_angles)
    jacobian = compute_jacobians(robot.chain, angles, robot.chain.end_effector)
    by_repeats = jacobian * robots.joint_std_rad
    parameter_covariance = by_parameters @ by_parameters.transpose(0, 2, 1)
    repeat_covariance = by_repeats @ by_repeats.transpose(0, 2, 1)
    covariance = (parameter_covariance + repeat_covariance)[:, :3, :3]
    additional = np.maximum(
        regression.squares - np.trace(covariance, axis1=1, axis2=2), 0.0
    )
    errors = repeating.simulate_errors(by_parameters[:, :3], by_repeats[:, :3])
    if regression.active.any():
        std = np.sqrt(additional[0] / 3.0)
        errors += std[:, None, None] * robots.stream.standard_normal(errors.shape)
    squares = np.einsum("kid,kid->kd", errors, errors)
    return _ChunkErrors(
        parameter_covariance,
        repeat_covariance,
        additional,
        _predict_left_out_errors(calibrated, reported_angles, wrench, pose),
        repeating.restore_order(squares.sum(axis=0)),
        repeating.restore_order(squares.max(axis=0)),
    )


def _compute_placed_sensitivities(
    calibrated: CalibratedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    pose: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Compute sensitivities (K, 6, P) of the poses after the best placement."""
    columns = compute_placement_columns(calibrated.scope, *pose)
    sensitivities = compute_pose_sensitivities(calibrated, reported_angles, wrench)
    return np.asarray(sensitivities - columns @ calibrated.scope.absorbed)


def compute_length_quantiles(
    covariance: np.ndarray, branches: np.ndarray | None = None
) -> np.ndarray:
    """Compute the quantile with `CONFIDENCE` of the length of normal vectors, whose mean
    is one of several that are equally probable.

    The squared length about each mean is approximated by the gamma distribution with the
    same mean and variance [1].

    Parameters
    ----------
    covariance : (N, 3, 3) covariances of the vectors.
    branches : (N, K, 3) their possible means; None for zero.

    Returns
    -------
    (N,) quantiles, in the unit of the vectors.

    References
    ----------
    .. [1] Satterthwaite, F. E., An approximate distribution of estimates of variance
       components, Biometrics Bulletin 2, 1946.
    """
    if branches is None:
        branches = np.zeros((len(covariance), 1, 3))
    mean = np.trace(covariance, axis1=1, axis2=2)[:, None] + (branches**2).sum(axis=2)
    variance = 2.0 * (covariance**2).sum(axis=(1, 2))[:, None] + 4.0 * (
        branches @ covariance * branches
    ).sum(axis=2)
    # Zero lengths, and lengths that do not vary, have no distribution of this kind.
    positive_mean = np.where(mean > 0.0, mean, 1.0)
    variance = np.maximum(variance, _MIN_RELATIVE_VARIANCE * positive_mean**2)
    shape = positive_mean**2 / variance
    quantiles = gammaincinv(shape, CONFIDENCE) * mean / shape
    # The quantile of the mixture lies between those of its branches.
    low = quantiles.min(axis=1)
    high = quantiles.max(axis=1)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        shares = middle[:, None] * shape / positive_mean
        probability = gammainc(shape, shares).mean(axis=1)
        low = np.where(probability < CONFIDENCE, middle, low)
        high = np.where(probability < CONFIDENCE, high, middle)
    return np.sqrt(high)


def compute_uncorrected_errors(
    calibrated: CalibratedRobot,
    position: np.ndarray,
    rotation: np.ndarray,
    differences: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the errors of an uncorrected robot after its best placement.

    Parameters
    ----------
    calibrated : the robot; its scope says how it is placed.
    position, rotation : (N, 3), m, and (N, 3, 3) poses of the end effector, base axes.
    differences : (N, 6) these poses less those of the calibrated robot, m and rad, base
        axes.

    Returns
    -------
    position_m, orientation_rad : (N,) errors.
    """
    scope = calibrated.scope
    columns = compute_placement_columns(scope, position, rotation)
    errors = differences - columns @ scope.absorbed_before
    return np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)


def select_campaign_commands(
    calibrated: CalibratedRobot,
) -> tuple[np.ndarray, np.ndarray]:
    """Select commands (N, n) and loads (N, 6) of the campaign over which its accuracy is
    stated: all, or evenly spaced ones of a very large campaign."""
    states = calibrated.states
    chosen = _select_evenly(len(states))
    commands = calibrated.robot.reported_angles(states.joint_angles[chosen])
    return commands, states.wrench[chosen]


def _select_evenly(count: int) -> np.ndarray:
    """Select the indices of all of a number of states, or of `_MOST_STATES` that are
    evenly spaced."""
    return np.unique(np.linspace(0, count - 1, min(count, _MOST_STATES)).astype(int))


def predict_campaign_accuracy(calibrated: CalibratedRobot) -> Accuracy:
    """Predict the accuracy over the poses of the campaign, which describes the robot as
    a whole."""
    commands = select_campaign_commands(calibrated)
    return predict_errors(calibrated, *commands).summarize(REGION)


def inflate_to_held_out_errors(
    calibrated: CalibratedRobot, held_out: Case, residual: np.ndarray, noise_m: float
) -> CalibratedRobot:
    """Raise the predicted errors of a robot if its held-out poses contradict them.

    The test statistic is the mean squared residual of the targets at the end effector.
    It is compared with those of simulated robots, of a very large campaign at evenly
    spaced poses, and of simulated noise. The excess counts as error of the model's form.
    Nothing changes if the noise is unknown.

    Parameters
    ----------
    calibrated : the robot with its predicted errors.
    held_out : poses that were not fitted.
    residual : (M, 3) residuals of the robot's model there, m.
    noise_m : standard deviation of the tracker in a coordinate.
    """
    end_effector = calibrated.robot.chain.end_effector.name
    observations = held_out.observations
    states = observations.states
    at_end = [target.point == end_effector for target in held_out.campaign.targets]
    tested = np.array(at_end)[observations.target]
    if calibrated.noise.source == "residual" or not tested.any():
        return calibrated
    state = observations.state[tested]
    tested_states = np.unique(state)
    chosen = tested_states[_select_evenly(len(tested_states))]
    commands = calibrated.robot.reported_angles(states.joint_angles[chosen])
    predicted = predict_errors(
        _with_all_effects(calibrated), commands, states.wrench[chosen]
    )
    sensor_variance = noise_m**2 / states.repeats[state]
    drawn_noise = _draw_mean_squares(sensor_variance, len(predicted.rms_m))
    mean_square = float((residual[tested] ** 2).sum(axis=1).mean())
    if (predicted.rms_m**2 + drawn_noise < mean_square).mean() <= CONFIDENCE:
        return calibrated
    explained = (predicted.error_m**2 - predicted.form_m**2).mean()
    excess = mean_square - 3.0 * sensor_variance.mean() - explained
    return set_form_error(calibrated, float(np.sqrt(excess)), contradicted=True)


def _draw_mean_squares(variance: np.ndarray, draws: int) -> np.ndarray:
    """Draw mean squared lengths (draws,) of normal vectors with these variances (M,) of a
    coordinate. The squares of vectors with one variance are drawn as one sum."""
    stream = np.random.default_rng(_SEED)
    variances, count = np.unique(variance, return_counts=True)
    chi_squares = stream.chisquare(3 * count[:, None], (len(variances), draws))
    return np.asarray(variances @ chi_squares / len(variance))


def _with_all_effects(calibrated: CalibratedRobot) -> CalibratedRobot:
    """Return a robot whose errors leave nothing out, as the residuals of the model with
    all its effects do."""
    scope = replace(calibrated.scope, left_out=(), left_out_effects=None)
    return replace(calibrated, scope=scope)
