"""Held-out errors: metrics and intervals agree with direct computations, the noise
floor with a simulation, and predictions of left-out poses with refits."""

from dataclasses import replace

import numpy as np
import pytest
from planted import ELBOW_AND_HAND, planted
from scipy.stats import t as student
from synthetic import (
    NOISE,
    add_noise,
    make_estimate,
    make_model,
    make_states,
    observe_exactly,
)

from elastocal.campaigns.campaign import Target
from elastocal.fitting.least_squares import (
    CONVERGENCE_TOLERANCE,
    evaluate_as_fit,
    fit_model,
)
from elastocal.fitting.model import apply_step
from elastocal.fitting.noise import Noise, set_prior_scale
from elastocal.fitting.observations import index_poses, select_states
from elastocal.validation.held_out import (
    METRICS,
    PositionErrors,
    bound_share_below_maximum,
    compute_error_intervals,
    compute_noise_floor,
    compute_position_errors,
    compute_position_residuals,
    predict_left_out_residuals,
    refit_without_folds,
    summarize_errors,
    summarize_errors_by_range,
)


def test_the_summary_of_four_errors_agrees_with_a_computation_by_hand():
    summary = summarize_errors(np.array([3.0, 4.0, 0.0, 5.0]))
    assert set(summary) == set(METRICS)
    assert summary["mean_m"] == 3.0
    assert summary["rms_m"] == pytest.approx(np.sqrt(50 / 4))
    assert summary["max_m"] == 5.0
    # The percentile is at 0.95 · 3 = 2.85, between the third and the fourth value.
    assert summary["p95_m"] == pytest.approx(4.0 + 0.85 * 1.0)


@pytest.fixture
def errors():
    """Errors of two models on poses with different numbers of measurements, in random
    order."""
    rng = np.random.default_rng(4)
    cluster = rng.permutation(np.repeat(np.arange(7), [1, 2, 3, 4, 5, 6, 7]))
    distance = rng.random(len(cluster)) * (1 + cluster)
    return [
        PositionErrors(distance, cluster),
        PositionErrors(0.4 * distance + 0.1 * rng.random(len(cluster)), cluster),
    ]


def jackknife_log_ratio(numerators, denominators):
    """Return the logarithm of the ratio of two totals over poses, and its standard
    error by leaving out each pose in turn."""
    poses = len(numerators)
    left_out = np.array(
        [
            np.log(
                np.delete(numerators, pose).sum() / np.delete(denominators, pose).sum()
            )
            for pose in range(poses)
        ]
    )
    variance = (poses - 1) / poses * ((left_out - left_out.mean()) ** 2).sum()
    return np.log(numerators.sum() / denominators.sum()), np.sqrt(variance)


def bootstrap_log_ratio(numerators, denominators, resamples):
    """Return the 95 % bootstrap-t interval of the logarithm of a ratio of totals.

    The quantiles are limited to those of Student's t with two degrees of freedom.
    """
    value, error = jackknife_log_ratio(numerators, denominators)
    replicates = np.array(
        [
            jackknife_log_ratio(numerators[poses], denominators[poses])
            for poses in resamples
            if len(set(poses)) > 1
        ]
    )
    pivots = (replicates[:, 0] - value) / replicates[:, 1]
    limit = student.ppf(0.975, 2)
    low, high = np.clip(np.quantile(pivots, [0.025, 0.975]), -limit, limit)
    return [value - high * error, value - low * error]


def test_intervals_are_those_of_a_bootstrap_t_over_whole_poses(errors):
    """The reference goes pose by pose and replicate by replicate, as in textbooks."""
    intervals, reductions = compute_error_intervals(
        errors, 300, np.random.default_rng(5)
    )
    before, after = (
        np.bincount(of_model.cluster, of_model.distance**2) for of_model in errors
    )
    counts = np.bincount(errors[0].cluster)
    draws = np.random.default_rng(5).multinomial(7, np.full(7, 1 / 7), 300)
    resamples = [np.repeat(np.arange(7), times) for times in draws]
    np.testing.assert_allclose(
        np.log(intervals[1]["rms_m"] ** 2),
        bootstrap_log_ratio(after, counts, resamples),
        rtol=1e-9,
    )
    unchanged, reduction = reductions
    np.testing.assert_allclose(
        2 * np.log([1 - reduction.high, 1 - reduction.low]),
        bootstrap_log_ratio(after, before, resamples),
        rtol=1e-9,
    )
    ratio = np.sqrt(after.sum() / before.sum())
    assert reduction.std_error == pytest.approx(
        0.5 * ratio * jackknife_log_ratio(after, before)[1]
    )
    limits = unchanged.low, unchanged.high, unchanged.std_error
    assert limits == (0.0, 0.0, 0.0)


def test_the_interval_stays_finite_if_one_pose_has_most_of_the_error():
    distance = np.array([1.0, 1.1, 0.9, 1.05, 1.0, 0.95, 0.9, 1.0, 60.0])
    errors = PositionErrors(distance, np.arange(9))
    intervals, _ = compute_error_intervals([errors], 400, np.random.default_rng(9))
    low, high = intervals[0]["rms_m"]
    value, error = jackknife_log_ratio(distance**2, np.ones(9))
    assert np.log(high**2) == pytest.approx(value + student.ppf(0.975, 2) * error)
    assert low < 20.0


def test_a_maximum_has_no_interval_but_a_bound_on_the_share_of_poses_below_it(errors):
    interval = compute_error_intervals(errors, 50, np.random.default_rng(6))[0][0]
    assert np.isnan([interval["p95_m"], interval["max_m"]]).all()
    assert np.isfinite([interval["mean_m"], interval["rms_m"]]).all()
    # In 95 % of the samples of 12 poses, at least this share of all poses stays below
    # the maximum of the sample. With 4,000 samples, 1.1 % are 3.2 standard errors, and
    # a share of 93 % is detected with a power of 0.98.
    maximum = np.random.default_rng(7).random((4000, 12)).max(axis=1)
    assert (maximum > bound_share_below_maximum(12)).mean() == pytest.approx(
        0.95, abs=0.011
    )


def test_one_pose_has_no_interval():
    errors = PositionErrors(np.array([1.0, 2.0]), np.zeros(2, int))
    intervals, reductions = compute_error_intervals(
        [errors] * 2, 50, np.random.default_rng(7)
    )
    assert all(np.isnan(limits).all() for limits in intervals[0].values())
    assert np.isnan(reductions[1].low)


@pytest.mark.parametrize("poses", [2, 3, 5, 6])
def test_intervals_of_up_to_five_poses_are_students_and_of_six_are_bootstrapped(poses):
    cluster = np.repeat(np.arange(poses), 3)
    distance = 1.0 + np.random.default_rng(poses).random(3 * poses)
    errors = PositionErrors(distance, cluster)
    intervals, _ = compute_error_intervals([errors], 50, np.random.default_rng(8))
    value, error = jackknife_log_ratio(
        np.bincount(cluster, distance), np.bincount(cluster)
    )
    of_student = value + error * student.ppf([0.025, 0.975], poses - 1)
    is_student = np.allclose(np.log(intervals[0]["mean_m"]), of_student)
    assert is_student == (poses < 6)


def simulate_mean_errors(model, estimate, states, noise, campaigns):
    """Simulate campaigns of the true model, in which the joints come to rest anew at
    each approach, and return the position errors of the means over repeats: ndarray
    (campaigns, M, 3)."""
    rng = np.random.default_rng(10)
    repeats = states.repeats[0]
    exact = observe_exactly(model, estimate, states).position
    errors = []
    for _ in range(campaigns):
        joint_errors = noise.joint_rad * rng.standard_normal(
            (repeats, *states.joint_angles.shape)
        )
        at_rest = [
            observe_exactly(
                model,
                estimate,
                replace(states, joint_angles=states.joint_angles + error),
            ).position
            for error in joint_errors
        ]
        measured = [
            position + noise.position_m * rng.standard_normal(position.shape)
            for position in at_rest
        ]
        errors.append(np.mean(measured, axis=0) - exact)
    return np.array(errors)


@pytest.mark.parametrize(("rows", "repeats"), [(3, 3), (6, 1)])
def test_the_noise_floor_is_the_error_of_the_true_model_in_a_simulation(
    rows, repeats, fanuc
):
    noise = Noise(
        "repeats", 40e-6, 80e-6, np.array([30, 20, 25, 0, 10, 40]) * 1e-6, 1000
    )
    model = make_model(
        fanuc.chain,
        ELBOW_AND_HAND,
        rows,
        fitted_frames=False,
        compliance=fanuc.compliance,
    )
    states = make_states(6, 20, seed=8, repeats=repeats)
    estimate = make_estimate(model, seed=9)
    observations = observe_exactly(model, estimate, states)
    fit = fit_model(model, observations, noise, estimate)
    errors = simulate_mean_errors(model, estimate, states, noise, campaigns=60)
    simulated = np.sqrt((errors**2).sum(axis=-1).mean())
    # Two targets share the joint errors of 1,200 states, so the standard error of the
    # simulation is 1.5 %. 5 % are 3.3 standard errors, and a floor that is wrong by a
    # tenth is detected with a power of 0.99.
    assert compute_noise_floor(fit, observations, model, estimate) == pytest.approx(
        simulated, rel=0.05
    )


def test_there_is_no_noise_floor_if_the_noise_is_unknown(fanuc):
    campaign = planted(fanuc, {}, poses=8)
    fit = fit_model(
        campaign.declared.model,
        campaign.observations,
        Noise("residual", 1e-4, 1e-4, np.zeros(6)),
        campaign.declared.estimate,
    )
    floor = compute_noise_floor(fit, campaign.observations, fit.model, fit.estimate)
    assert np.isnan(floor)


def test_errors_are_summarized_inside_and_outside_the_range():
    cluster = np.array([0, 0, 1, 2])
    errors = {
        "before": PositionErrors(np.array([1.0, 1.0, 4.0, 2.0]), cluster),
        "after": PositionErrors(np.array([0.5, 0.5, 3.0, 1.0]), cluster),
    }
    summary = summarize_errors_by_range(errors, np.array([False, True, False]))
    assert summary["poses"] == 1
    assert summary["outside"]["before"]["max_m"] == 4.0
    assert summary["outside"]["after"]["mean_m"] == 3.0
    assert summary["inside"]["before"]["mean_m"] == pytest.approx(4 / 3)
    assert summary["inside"]["after"]["max_m"] == 1.0
    assert summarize_errors_by_range(errors, np.zeros(3, bool))["outside"] is None


def average_by_pose(values, cluster):
    """Return the mean of some values for each pose."""
    return np.bincount(cluster, values) / np.bincount(cluster)


@pytest.mark.parametrize("poses_a_group", [1, 2])
def test_predicted_squares_of_left_out_poses_are_those_of_refits(poses_a_group, kuka):
    keys = [f"joint_offset@{joint}" for joint in (2, 3, 4, 5)]
    campaign = planted(
        kuka, {key: [5e-4] for key in keys}, seed=3, poses=8, fitted_frames=True
    )
    observations = campaign.observations
    model = set_prior_scale(
        campaign.declared.model.with_effects(
            [campaign.candidates[key] for key in keys]
        ),
        0.3,
    )
    fit = fit_model(model, observations, campaign.declared.noise)
    group = index_poses(observations.states) // poses_a_group
    cluster = observations.cluster // poses_a_group
    residual = predict_left_out_residuals(fit, observations, cluster)
    predicted = average_by_pose((residual[:, :3] ** 2).sum(axis=1), cluster)
    refitted = []
    for number in range(group.max() + 1):
        left_out_pose = select_states(observations, group == number)
        others = select_states(observations, group != number)
        estimate = fit_model(model, others, fit.noise, fit.estimate).estimate
        exact = compute_position_residuals(model, estimate, left_out_pose)
        refitted.append((exact**2).sum(axis=1).mean())
    np.testing.assert_allclose(np.sqrt(predicted), np.sqrt(refitted), rtol=0.1)
    fitted = average_by_pose((fit.residual[:, :3] ** 2).sum(axis=1), cluster)
    assert np.mean(predicted) > 1.2 * np.mean(fitted)


def test_left_out_residuals_are_those_of_the_fit_if_nothing_is_fitted(kuka):
    campaign = planted(kuka, {}, seed=5, poses=6)
    observations = campaign.observations
    fit = fit_model(
        replace(campaign.declared.model, effects=()),
        observations,
        campaign.declared.noise,
    )
    assert fit.unidentifiable.size == 0
    residual = predict_left_out_residuals(fit, observations, observations.cluster)
    np.testing.assert_allclose(residual, fit.residual)


def fit_loaded_poses(robot, is_loaded, poses=24):
    """Fit joint compliances that are twice the nominal ones to poses of which only some
    carry a load.

    Returns the fit and its observations.
    """
    targets = [Target(name, robot.chain.end_effector.name, None) for name in "AB"]
    model = make_model(
        robot.chain, targets, compliance=robot.compliance, identified=True
    )
    states = make_states(6, poses, seed=1)
    states = replace(states, wrench=np.where(is_loaded[:, None], states.wrench, 0.0))
    estimate = replace(
        make_estimate(model, (0,), seed=2), coefficients=(2.0 * robot.compliance,)
    )
    observations = add_noise(
        observe_exactly(model, estimate, states), np.random.default_rng(3)
    )
    return fit_model(model, observations, NOISE), observations


# Four folds of six poses each.
FOLD = np.arange(24) // 6
ALL_LOADED = np.ones(24, bool)


def test_parameters_that_only_the_left_out_fold_identifies_return_to_their_prior(fanuc):
    fit, observations = fit_loaded_poses(fanuc, FOLD == 1)
    (compliances,) = fit.estimate.coefficients
    assert not fit.unidentifiable[-6:].any()
    assert compliances[0] > 1.9 * fanuc.compliance[0]
    refits = list(refit_without_folds(fit, observations, FOLD))
    for number in (0, 2, 3):
        assert refits[number].coefficients[0][0] > 1.9 * fanuc.compliance[0]
    assert len(refits) == 4
    # Where nothing is measured a compliance is at the mode of its half-normal prior.
    assert not refits[1].coefficients[0].any()
    new_fit = fit_model(fit.model, select_states(observations, FOLD != 1), NOISE)
    left_out = select_states(observations, FOLD == 1)
    errors = compute_position_residuals(fit.model, refits[1], left_out)
    expected = compute_position_residuals(fit.model, new_fit.estimate, left_out)
    np.testing.assert_allclose(errors, expected, atol=1e-2 * NOISE.position_m)
    assert np.abs(errors).max() > 10 * NOISE.position_m


def test_refits_take_further_steps_until_they_have_converged(fanuc):
    """They start at an estimate so far off that its linearization is not enough."""
    fit, observations = fit_loaded_poses(fanuc, ALL_LOADED)
    step = np.where(np.arange(len(fit.unidentifiable)) < 6, 0.3, 0.0)
    far_estimate = apply_step(fit.model, fit.estimate, step)
    far_fit = evaluate_as_fit(fit.model, observations, NOISE, far_estimate)
    for from_far, from_fit in zip(
        refit_without_folds(far_fit, observations, FOLD),
        refit_without_folds(fit, observations, FOLD),
        strict=True,
    ):
        np.testing.assert_allclose(
            compute_position_residuals(fit.model, from_far, observations),
            compute_position_residuals(fit.model, from_fit, observations),
            atol=1e-3 * NOISE.position_m,
        )


def test_a_refit_that_does_not_converge_is_repeated_without_a_start(fanuc, monkeypatch):
    fit, observations = fit_loaded_poses(fanuc, ALL_LOADED)

    def fit_without_convergence(*arguments, **options):
        if options:
            return replace(fit, converged=False)
        return fit_model(*arguments)

    monkeypatch.setattr(
        "elastocal.validation.held_out.fit_model", fit_without_convergence
    )
    refit = next(refit_without_folds(fit, observations, FOLD))
    new_fit = fit_model(fit.model, select_states(observations, FOLD != 0), NOISE)
    np.testing.assert_array_equal(
        refit.coefficients[0], new_fit.estimate.coefficients[0]
    )


def test_a_target_that_only_the_left_out_fold_measures_is_placed_as_without_a_start(
    fanuc,
):
    fit, complete = fit_loaded_poses(fanuc, ALL_LOADED)
    kept = (complete.target != 1) | (FOLD[complete.state] == 2)
    observations = replace(
        complete,
        state=complete.state[kept],
        target=complete.target[kept],
        position=complete.position[kept],
        rotation=None if complete.rotation is None else complete.rotation[kept],
    )
    fit = fit_model(fit.model, observations, NOISE, fit.estimate)
    refit = list(refit_without_folds(fit, observations, FOLD))[2]
    new_fit = fit_model(fit.model, select_states(observations, FOLD != 2), NOISE)
    offset = refit.target_offset[1]
    np.testing.assert_array_equal(offset, new_fit.estimate.target_offset[1])
    assert np.abs(offset - fit.estimate.target_offset[1]).max() > 1e-3


def fit_sessions(robot, poses=24, sessions=3):
    """Fit a frame to each session; return the fit and its observations."""
    model = make_model(robot.chain, compliance=robot.compliance, identified=True)
    states = make_states(6, poses, seed=1, sessions=sessions)
    estimate = make_estimate(model, tuple(range(sessions)), seed=2)
    estimate = replace(estimate, coefficients=(robot.compliance,))
    observations = add_noise(
        observe_exactly(model, estimate, states), np.random.default_rng(3)
    )
    return fit_model(model, observations, NOISE), observations


def compute_left_out_errors(fit, observations, fold):
    """Return the distance of each observation from its prediction by the refit without
    its fold."""
    distances = [
        compute_position_errors(fit.model, refit, observations).distance
        for refit in refit_without_folds(fit, observations, fold)
    ]
    fold_index = np.unique(fold, return_inverse=True)[1]
    return np.choose(fold_index[observations.state], distances)


def test_left_out_errors_are_those_of_a_fit_to_the_remaining_folds(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=16)
    observations = campaign.observations
    fit = campaign.declared
    fold = np.arange(16).repeat(2) // 4
    errors = compute_left_out_errors(fit, observations, fold)
    for number in range(4):
        refit = fit_model(
            fit.model, select_states(observations, fold != number), fit.noise
        )
        expected = compute_position_errors(
            fit.model, refit.estimate, select_states(observations, fold == number)
        ).distance
        # The predictions agree to the tolerance of convergence, a share of their
        # standard error, which is smaller than the noise.
        np.testing.assert_allclose(
            errors[fold[observations.state] == number],
            expected,
            atol=CONVERGENCE_TOLERANCE * fit.noise.position_m,
        )


def test_a_fit_to_all_observations_can_be_refitted_to_a_subset(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=20)
    fit = campaign.declared
    observations = campaign.observations
    subset = select_states(observations, observations.states.pose < 12)
    fold = np.arange(12).repeat(2) // 4
    errors = compute_left_out_errors(fit, subset, fold)
    subset_fit = fit_model(fit.model, subset, fit.noise)
    expected = compute_left_out_errors(subset_fit, subset, fold)
    np.testing.assert_allclose(errors, expected, atol=1e-3 * fit.noise.position_m)


def test_a_session_that_is_left_out_is_placed_by_itself(fanuc):
    fit, observations = fit_sessions(fanuc)
    errors = compute_left_out_errors(fit, observations, observations.states.session)
    assert summarize_errors(errors)["rms_m"] == pytest.approx(
        np.sqrt(3) * NOISE.position_m, rel=0.25
    )
