"""Predicted errors: bounds, frames, quantiles, and what held-out poses change."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, make_calibrated_robot
from made_folders import make_folder, make_table
from scipy.spatial.transform import Rotation
from scipy.stats import chi, norm
from support import robot_of
from synthetic import make_states

from elastocal.application import accuracy
from elastocal.application.accuracy import (
    compute_determined_covariance,
    compute_length_quantiles,
    compute_uncorrected_errors,
    inflate_to_held_out_errors,
    predict_campaign_accuracy,
    predict_determined_rms_m,
    predict_errors,
)
from elastocal.application.calibrated import predict_poses
from elastocal.application.frames import BASE, ROBOT, Scope, subtract_placement
from elastocal.application.scope import calibrate_on_case, determine_scope
from elastocal.application.statements import format_accuracy
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import apply_step
from elastocal.fitting.noise import Noise, set_prior_std
from elastocal.loop.whole import read_cases
from elastocal.validation.conformity import decide_conformity
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit

STATES = replace(make_states(6, 60), wrench=np.zeros((60, 6)))


def with_scope(calibrated, *, unknown_base):
    model = replace(calibrated.model, fitted_frames=unknown_base)
    scope = determine_scope(
        calibrated, model, calibrated.estimate, calibrated.covariance, STATES
    )
    return replace(calibrated, scope=scope, fitted=STATES)


def simulate_errors(calibrated, commands, *, unknown_base):
    """Simulate the position errors (robots, poses) of 150 robots that are drawn from the
    covariance, m."""
    position, _ = predict_poses(calibrated, commands)
    scope = Scope(ROBOT, position.mean(axis=0))
    stream = np.random.default_rng(3)
    root = np.linalg.cholesky(calibrated.covariance)
    lengths = []
    for _ in range(150):
        step = root @ stream.standard_normal(len(root))
        estimate = apply_step(calibrated.model, calibrated.estimate, step)
        drawn = replace(calibrated, estimate=estimate)
        error = (predict_poses(drawn, commands)[0] - position)[..., None]
        if unknown_base:
            fields = np.concatenate([error, 0 * error], axis=1)
            error = subtract_placement(scope, position, np.zeros((60, 3, 3)), fields)
        lengths.append(np.linalg.norm(error[:, :3, 0], axis=1))
    return np.array(lengths)


@pytest.mark.parametrize("unknown_base", [False, True])
def test_bounds_hold_for_95_percent_of_robots_drawn_from_the_covariance(
    fanuc, unknown_base
):
    """Of 150 robots; 90 to 100 % are within nearly three standard errors."""
    calibrated = with_scope(
        make_calibrated_robot(fanuc, *USUAL), unknown_base=unknown_base
    )
    commands = calibrated.robot.reported_angles(STATES.joint_angles)
    accuracy = predict_errors(calibrated, commands, STATES.wrench).summarize("")
    assert accuracy.frame == (ROBOT if unknown_base else BASE)
    errors = simulate_errors(calibrated, commands, unknown_base=unknown_base)
    rms = np.sqrt((errors**2).mean(axis=1))
    below_rms_bound = np.mean(rms < accuracy.rms_bound_m)
    below_worst_bound = np.mean(errors.max(axis=1) < accuracy.worst_bound_m)
    assert np.sqrt(np.mean(rms**2)) == pytest.approx(accuracy.rms_m, rel=0.08)
    assert below_rms_bound == pytest.approx(0.95, abs=0.05)
    assert below_worst_bound == pytest.approx(0.95, abs=0.05)


def test_a_misplaced_base_is_an_error_only_if_the_base_is_known(fanuc):
    calibrated = make_calibrated_robot(fanuc, "joint_offset@1")
    coefficients = (*calibrated.estimate.coefficients[:-1], np.array([1e-3]))
    estimate = replace(calibrated.estimate, coefficients=coefficients)
    calibrated = replace(calibrated, estimate=estimate)
    commands = calibrated.robot.reported_angles(STATES.joint_angles)
    position, rotation = predict_poses(calibrated, commands)
    turn = np.array([0.0, 0.0, -1e-3])
    shift = position @ Rotation.from_rotvec(turn).as_matrix().T - position
    differences = np.concatenate([shift, np.tile(turn, (60, 1))], axis=1)
    errors_if_known, turns = compute_uncorrected_errors(
        with_scope(calibrated, unknown_base=False), position, rotation, differences
    )
    errors_if_unknown, placed_turns = compute_uncorrected_errors(
        with_scope(calibrated, unknown_base=True), position, rotation, differences
    )
    lever = np.linalg.norm(position[:, :2], axis=1)
    np.testing.assert_allclose(errors_if_known, 1e-3 * lever, rtol=1e-2)
    np.testing.assert_allclose(turns, 1e-3)
    assert np.mean(placed_turns**2) < np.mean(turns**2)
    # The placement cannot absorb the springs, which are not in `differences`.
    assert np.mean(errors_if_unknown**2) < np.mean(errors_if_known**2)


def test_quantiles_are_exact_in_one_and_in_three_directions():
    isotropic = np.eye(3)
    single = np.diag([1.0, 0.0, 0.0])
    covariances = np.stack([isotropic, single, np.zeros((3, 3))])
    np.testing.assert_allclose(
        compute_length_quantiles(covariances),
        [chi.ppf(0.95, 3), norm.ppf(0.975), 0.0],
        rtol=1e-12,
    )


def test_quantiles_are_those_of_branches_whichever_is_true():
    """Of 200,000 draws; a gamma distribution of each square is a percent off."""
    stream = np.random.default_rng(1)
    covariance = np.diag([4.0, 1.0, 0.25])
    for size in (0.5, 2.0, 6.0):
        branches = size * np.array([[1.0, 1.0, 0.0], [-1.0, 0.0, 2.0]])
        drawn = branches[stream.integers(2, size=200_000)]
        drawn = drawn + stream.standard_normal(drawn.shape) * np.sqrt(
            np.diag(covariance)
        )
        (quantile,) = compute_length_quantiles(covariance[None], branches[None])
        held = np.mean(np.linalg.norm(drawn, axis=1) < quantile)
        assert held == pytest.approx(0.95, abs=0.02), size
    (narrow,) = compute_length_quantiles(np.zeros((1, 3, 3)), np.ones((1, 4, 3)))
    assert narrow == pytest.approx(np.sqrt(3.0), rel=0.01)


@pytest.fixture(scope="module")
def campaign(kuka, tmp_path_factory, config_folder):
    """Case, held-out case, fit and calibrated robot of a campaign."""
    folder = tmp_path_factory.mktemp("judged") / "made"
    folder = make_folder(folder, kuka, table=make_table(kuka, "made"))
    case, held_out = read_cases(folder, config_folder / "robots")
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    fit = fit_model(case.model, case.observations, noise)
    calibrated = calibrate_on_case(case, fit.model, fit.estimate, fit.covariance, noise)
    return case, held_out, fit, calibrated


def inflate(calibrated, fit, case, held_out):
    residual = compute_position_residuals(
        *transfer_fit(fit, case, held_out), held_out.observations
    )
    return inflate_to_held_out_errors(
        calibrated, held_out, residual, fit.noise.position_m
    )


def test_held_out_poses_with_larger_errors_raise_the_prediction_if_the_noise_is_known(
    campaign,
):
    case, held_out, fit, calibrated = campaign
    assert inflate(calibrated, fit, case, held_out) is calibrated
    observations = held_out.observations
    shifted = observations.position + np.array([1e-3, 0.0, 0.0])
    missed = replace(held_out, observations=replace(observations, position=shifted))
    accuracy = predict_campaign_accuracy(inflate(calibrated, fit, case, missed))
    assert accuracy.contradicted and accuracy.rms_m == pytest.approx(1e-3, rel=0.1)
    unknown_noise = replace(calibrated.noise, source="residual")
    uncertain = replace(calibrated, noise=unknown_noise)
    assert inflate(uncertain, fit, case, missed) is uncertain


def test_no_error_of_zero_is_predicted_of_a_robot_of_which_nothing_was_fitted(fanuc):
    calibrated = make_calibrated_robot(fanuc, relative_std=0.0)
    commands, wrench = np.zeros((2, 3, 6))
    accuracy = predict_errors(calibrated, commands, wrench).summarize("some poses")
    assert accuracy.rms_m == 0.0 and not accuracy.fitted
    sentence = format_accuracy(accuracy)
    assert "nothing of the robot was fitted" in sentence and "0.000" not in sentence


def test_the_uncertain_form_of_the_model_is_in_every_figure(fanuc):
    calibrated = make_calibrated_robot(fanuc, relative_std=0.0)
    scope = replace(calibrated.scope, form_m=1e-3, contradicted=True)
    contradicted = replace(calibrated, scope=scope)
    prediction = predict_errors(contradicted, *np.zeros((2, 3, 6)))
    accuracy = prediction.summarize("some poses")
    assert accuracy.rms_m == pytest.approx(1e-3, rel=0.01)
    assert min(accuracy.rms_bound_m, accuracy.worst_m) > 1e-3
    assert (prediction.bound_m > 1e-3).all()
    assert "1.000 mm" in format_accuracy(accuracy)


PRIOR_RAD = 1e-3


def calibrate_one_joint(variance_left):
    """A joint with an arm of one metre, whose offset is known to a share of the variance
    of its prior."""
    calibrated = make_calibrated_robot(
        robot_of("Rz(q1) Tx(1) [A]"), "joint_offset@1", identified=False
    )
    (effect,) = calibrated.model.effects
    effect = set_prior_std(effect, np.array([PRIOR_RAD]))
    return replace(
        calibrated,
        model=replace(calibrated.model, effects=(effect,)),
        covariance=np.array([[variance_left * PRIOR_RAD**2]]),
    )


@pytest.mark.parametrize(
    ("variance_left", "expected"),
    [(1.0, "undecided"), (0.9, "undecided"), (0.1, "fail")],
)
def test_a_robot_fails_by_measurements_and_not_by_a_prior(variance_left, expected):
    """The error is the normally distributed offset times a metre. It is above a hundredth
    of its standard deviation with 99.2 % probability, whether a prior or measurements
    say so."""
    calibrated = calibrate_one_joint(variance_left)
    std_m = np.sqrt(variance_left) * PRIOR_RAD
    commands = np.linspace(-1.0, 1.0, 5)[:, None], np.zeros((5, 6))
    rms_m = predict_errors(calibrated, *commands).rms_m
    tolerance_m = 0.01 * std_m
    probability = 2.0 * norm.sf(0.01)
    assert (rms_m > tolerance_m).mean() == pytest.approx(probability, abs=0.01)
    decided = decide_conformity(
        rms_m, tolerance_m, 0.05, predict_determined_rms_m(calibrated, *commands)
    )
    assert decided.decision == expected
    # The bound still contains the prior: such a robot does not pass.
    assert decided.limit_m == pytest.approx(1.96 * std_m, rel=0.05)


def test_only_directions_that_the_measurements_leave_to_the_priors_are_fixed(fanuc):
    """Two parameters whose sum is measured: their difference is as the priors have it.
    A third one without a prior stays as it is, less what the difference says of it."""
    keys = ("joint_offset@2", "joint_offset@3", "joint_offset@4")
    robot = replace(fanuc, masses=())
    calibrated = make_calibrated_robot(robot, *keys, identified=False)
    first, second, third = calibrated.model.effects
    effects = [set_prior_std(effect, np.array([2e-3])) for effect in (first, second)]
    model = replace(calibrated.model, effects=(*effects, third))
    # Standard deviations of sum and difference (each over the root of two), and of the
    # third parameter, which goes with the difference.
    root = np.array(
        [
            [2e-5, 2e-3, 0.0],
            [2e-5, -2e-3, 0.0],
            [0.0, 3e-4, 4e-4],
        ]
    )
    root[:2] /= np.sqrt(2.0)
    calibrated = replace(calibrated, model=model, covariance=root @ root.T)
    expected = root[:, [0, 2]] @ root[:, [0, 2]].T
    determined = compute_determined_covariance(calibrated)
    np.testing.assert_allclose(determined, expected, atol=1e-12)


LONG_PATH = 2400


def predict_along_a_long_path(robot):
    """Predict the errors of a robot whose joints repeat to 10 µrad, and nothing else is
    uncertain."""
    noise = Noise("declared", 6e-5, 6e-5, np.full(robot.joints, 1e-5))
    calibrated = make_calibrated_robot(
        robot, "joint_offset@2", identified=False, relative_std=0.0, noise=noise
    )
    states = make_states(robot.joints, LONG_PATH, seed=5)
    commands = robot.reported_angles(states.joint_angles)
    return predict_errors(calibrated, commands, np.zeros((LONG_PATH, 6)))


def test_no_robot_meets_the_same_random_error_twice_on_a_long_path(fanuc, monkeypatch):
    """The mean square of the errors of a robot varies as that of independent errors does,
    to three standard errors of 2,000 draws; with numbers that repeat for one robot it
    would vary five times as much. The largest errors agree as well."""
    robot = replace(fanuc, masses=())
    predicted = predict_along_a_long_path(robot)
    monkeypatch.setattr(accuracy, "_DRAWN_CHUNKS", LONG_PATH)
    independent = predict_along_a_long_path(robot)
    spreads = [np.var(errors.rms_m**2) for errors in (predicted, independent)]
    standard_error = 3.0 * np.sqrt(2.0 * 2.0 / 2000)
    assert spreads[0] / spreads[1] == pytest.approx(1.0, abs=standard_error)
    for quantile in (0.05, 0.5, 0.95):
        largest = [
            np.quantile(errors.worst_m, quantile) for errors in (predicted, independent)
        ]
        assert largest[0] == pytest.approx(largest[1], rel=0.02)
