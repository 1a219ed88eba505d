"""Held-out errors: metrics by hand, intervals against a direct computation, the floor
against simulation; parts left out."""

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
    predict_left_out_squares,
    refit_without_folds,
    summarize_errors,
    summarize_errors_by_range,
)


def test_summary_by_hand():
    found = summarize_errors(np.array([3.0, 4.0, 0.0, 5.0]))
    assert set(found) == set(METRICS)
    assert found["mean_m"] == 3.0
    assert found["rms_m"] == pytest.approx(np.sqrt(50 / 4))
    assert found["max_m"] == 5.0
    # Between the third and the fourth, at 0.95 · 3 = 2.85.
    assert found["p95_m"] == pytest.approx(4.0 + 0.85 * 1.0)


@pytest.fixture
def errors():
    """Two models on poses of different numbers of measurements, not in order."""
    rng = np.random.default_rng(4)
    cluster = rng.permutation(np.repeat(np.arange(7), [1, 2, 3, 4, 5, 6, 7]))
    first = rng.random(len(cluster)) * (1 + cluster)
    return [
        PositionErrors(first, cluster),
        PositionErrors(0.4 * first + 0.1 * rng.random(len(cluster)), cluster),
    ]


def jackknifed(top, bottom):
    """Logarithm of a ratio of totals, and its standard error with each pose left out in
    turn."""
    poses = len(top)
    left = np.array(
        [
            np.log(np.delete(top, k).sum() / np.delete(bottom, k).sum())
            for k in range(poses)
        ]
    )
    return np.log(top.sum() / bottom.sum()), np.sqrt(
        (poses - 1) / poses * ((left - left.mean()) ** 2).sum()
    )


def test_intervals_are_those_of_a_bootstrap_t_over_whole_poses(errors):
    """Pose by pose and replicate by replicate, as the books have it."""
    found, reductions = compute_error_intervals(errors, 300, np.random.default_rng(5))
    totals = [np.bincount(one.cluster, one.distance**2) for one in errors]
    counts = np.bincount(errors[0].cluster)
    draws = np.random.default_rng(5)
    drawn = [
        np.repeat(np.arange(7), times)
        for times in draws.multinomial(7, np.full(7, 1 / 7), 300)
    ]
    for top, bottom, limits in (
        (totals[1], counts, np.log(found[1]["rms_m"] ** 2)),
        (
            totals[1],
            totals[0],
            2 * np.log([1 - reductions[1].high, 1 - reductions[1].low]),
        ),
    ):
        value, error = jackknifed(top, bottom)
        pairs = np.array(
            [
                jackknifed(top[poses], bottom[poses])
                for poses in drawn
                if len(set(poses)) > 1
            ]
        )
        # At most as far as Student's t of two degrees of freedom.
        farthest = student.ppf(0.975, 2)
        low, high = np.clip(
            np.quantile((pairs[:, 0] - value) / pairs[:, 1], [0.025, 0.975]),
            -farthest,
            farthest,
        )
        np.testing.assert_allclose(
            limits, [value - high * error, value - low * error], rtol=1e-9
        )
    ratio = np.sqrt(totals[1].sum() / totals[0].sum())
    assert reductions[1].std_error == pytest.approx(
        0.5 * ratio * jackknifed(totals[1], totals[0])[1]
    )
    assert (reductions[0].low, reductions[0].high, reductions[0].std_error) == (
        0.0,
        0.0,
        0.0,
    )


def test_a_pose_that_makes_most_of_the_error_does_not_make_the_interval_endless():
    distance = np.array([1.0, 1.1, 0.9, 1.05, 1.0, 0.95, 0.9, 1.0, 60.0])
    errors = PositionErrors(distance, np.arange(9))
    low, high = compute_error_intervals([errors], 400, np.random.default_rng(9))[0][0][
        "rms_m"
    ]
    value, error = jackknifed(distance**2, np.ones(9))
    assert np.log(high**2) == pytest.approx(value + student.ppf(0.975, 2) * error)
    assert low < 20.0


def test_a_maximum_has_no_interval_but_a_share_that_stays_below_it(errors):
    found = compute_error_intervals(errors, 50, np.random.default_rng(6))[0][0]
    assert (
        np.isnan([found["p95_m"], found["max_m"]]).all()
        and np.isfinite([found["mean_m"], found["rms_m"]]).all()
    )
    # Of many samples of 12 poses, 95 % have a maximum that at least this share of all
    # poses stays below. 4,000 samples: 1.1 % are 3.2 standard errors, and a share of 93
    # % is seen with a power of 0.98.
    largest = np.random.default_rng(7).random((4000, 12)).max(axis=1)
    assert (largest > bound_share_below_maximum(12)).mean() == pytest.approx(
        0.95, abs=0.011
    )


def test_one_pose_has_no_interval():
    found, reductions = compute_error_intervals(
        [PositionErrors(np.array([1.0, 2.0]), np.zeros(2, int))] * 2,
        50,
        np.random.default_rng(7),
    )
    assert all(np.isnan(limits).all() for limits in found[0].values())
    assert np.isnan(reductions[1].low)


@pytest.mark.parametrize("poses", [2, 3, 5, 6])
def test_few_poses_have_intervals_of_student_and_six_are_drawn(poses):
    cluster = np.repeat(np.arange(poses), 3)
    distance = 1.0 + np.random.default_rng(poses).random(3 * poses)
    found = compute_error_intervals(
        [PositionErrors(distance, cluster)], 50, np.random.default_rng(8)
    )[0][0]
    value, error = jackknifed(np.bincount(cluster, distance), np.bincount(cluster))
    of_student = value + error * student.ppf([0.025, 0.975], poses - 1)
    assert np.allclose(np.log(found["mean_m"]), of_student) == (poses < 6)


@pytest.mark.parametrize(("rows", "repeats"), [(3, 3), (6, 1)])
def test_noise_floor_is_what_the_noise_alone_leaves(rows, repeats, fanuc):
    """Measurements of the true model: joints that come to rest anew, and a sensor;
    repeats are averaged."""
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
    seen = observe_exactly(model, estimate, states)
    fitted = fit_model(model, seen, noise, estimate)
    rng = np.random.default_rng(10)
    off = []
    for _ in range(60):
        rests = noise.joint_rad * rng.standard_normal((repeats, 20, 6))
        moved = [
            observe_exactly(
                model,
                estimate,
                replace(states, joint_angles=states.joint_angles + rest),
            )
            for rest in rests
        ]
        positions = [
            one.position + noise.position_m * rng.standard_normal(one.position.shape)
            for one in moved
        ]
        off.append(np.mean(positions, axis=0) - seen.position)
    simulated = np.sqrt((np.array(off) ** 2).sum(axis=-1).mean())
    # Joints of 1,200 states share their errors over two targets: the simulation is sure
    # to 1.5 %, 5 % are 3.3 of that, and a floor that is off by a tenth is seen with a
    # power of 0.99.
    assert compute_noise_floor(fitted, seen, model, estimate) == pytest.approx(
        simulated, rel=0.05
    )


def test_no_noise_floor_where_the_noise_is_unknown(fanuc):
    campaign = planted(fanuc, {}, poses=8)
    fitted = fit_model(
        campaign.declared.model,
        campaign.observations,
        Noise("residual", 1e-4, 1e-4, np.zeros(6)),
        campaign.declared.estimate,
    )
    assert np.isnan(
        compute_noise_floor(
            fitted, campaign.observations, fitted.model, fitted.estimate
        )
    )


def test_errors_are_told_inside_and_outside_the_range():
    cluster = np.array([0, 0, 1, 2])
    errors = {
        "before": PositionErrors(np.array([1.0, 1.0, 4.0, 2.0]), cluster),
        "after": PositionErrors(np.array([0.5, 0.5, 3.0, 1.0]), cluster),
    }
    found = summarize_errors_by_range(errors, np.array([False, True, False]))
    assert found["poses"] == 1
    assert (
        found["outside"]["before"]["max_m"] == 4.0
        and found["outside"]["after"]["mean_m"] == 3.0
    )
    assert (
        found["inside"]["before"]["mean_m"] == pytest.approx(4 / 3)
        and found["inside"]["after"]["max_m"] == 1.0
    )
    assert summarize_errors_by_range(errors, np.zeros(3, bool))["outside"] is None


def test_left_out_squares_are_those_of_refits(kuka):
    keys = [f"joint_offset@{joint}" for joint in (2, 3, 4, 5)]
    campaign = planted(
        kuka, {key: [5e-4] for key in keys}, seed=3, poses=8, fitted_frames=True
    )
    model = set_prior_scale(
        campaign.declared.model.with_effects(
            [campaign.candidates[key] for key in keys]
        ),
        0.3,
    )
    fitted = fit_model(model, campaign.observations, campaign.declared.noise)
    found = predict_left_out_squares(fitted, campaign.observations)
    pose = index_poses(campaign.observations.states)
    refitted = []
    for number in range(pose.max() + 1):
        rest, alone = (
            select_states(
                campaign.observations, pose == number if mine else pose != number
            )
            for mine in (0, 1)
        )
        again = fit_model(model, rest, fitted.noise, fitted.estimate)
        refitted.append(
            (compute_position_residuals(model, again.estimate, alone) ** 2)
            .sum(axis=1)
            .mean()
        )
    np.testing.assert_allclose(np.sqrt(found), np.sqrt(refitted), rtol=0.1)
    inside = np.bincount(
        campaign.observations.cluster, (fitted.residual[:, :3] ** 2).sum(axis=1)
    )
    assert np.mean(found) > 1.2 * np.mean(
        inside / np.bincount(campaign.observations.cluster)
    )


def test_without_anything_to_fit_errors_are_the_residuals(kuka):
    campaign = planted(kuka, {}, seed=5, poses=6)
    bare = fit_model(
        replace(campaign.declared.model, effects=()),
        campaign.observations,
        campaign.declared.noise,
    )
    assert bare.unidentifiable.size == 0
    squares = (bare.residual[:, :3] ** 2).sum(axis=1)
    cluster = campaign.observations.cluster
    np.testing.assert_allclose(
        predict_left_out_squares(bare, campaign.observations),
        np.bincount(cluster, squares) / np.bincount(cluster),
    )


def loaded_in(robot, loaded, poses=24):
    """A fit of joint compliances twice the nominal ones to poses of which only some
    carry a load, and its observations."""
    targets = [Target(name, robot.chain.end_effector.name, None) for name in "AB"]
    model = make_model(
        robot.chain, targets, compliance=robot.compliance, identified=True
    )
    states = make_states(6, poses, seed=1)
    states = replace(states, wrench=np.where(loaded[:, None], states.wrench, 0.0))
    estimate = replace(
        make_estimate(model, (0,), seed=2), coefficients=(2.0 * robot.compliance,)
    )
    seen = add_noise(observe_exactly(model, estimate, states), np.random.default_rng(3))
    return fit_model(model, seen, NOISE), seen


def test_what_only_the_part_left_out_identifies_goes_back_to_where_fits_start(fanuc):
    part = np.arange(24) // 6
    fitted, seen = loaded_in(fanuc, part == 1)
    (found,) = fitted.estimate.coefficients
    assert not fitted.unidentifiable[-6:].any() and found[0] > 1.9 * fanuc.compliance[0]
    for number, refit in enumerate(refit_without_folds(fitted, seen, part)):
        (without,) = refit.coefficients
        if number == 1:
            np.testing.assert_allclose(without, fanuc.compliance, rtol=1e-12)
            from_nothing = fit_model(
                fitted.model, select_states(seen, part != 1), NOISE
            ).estimate
            left_out = select_states(seen, part == 1)
            errors = [
                compute_position_residuals(fitted.model, each, left_out)
                for each in (refit, from_nothing)
            ]
            np.testing.assert_allclose(*errors, atol=1e-2 * NOISE.position_m)
            assert np.abs(errors[0]).max() > 10 * NOISE.position_m
        else:
            assert without[0] > 1.9 * fanuc.compliance[0]


def test_a_step_that_equations_after_it_do_not_prove_is_followed_by_others(fanuc):
    """From an estimate far off, where what is linear about it says little of the
    rest."""
    part = np.arange(24) // 6
    fitted, seen = loaded_in(fanuc, np.ones(24, bool))
    off = apply_step(
        fitted.model,
        fitted.estimate,
        np.where(np.arange(len(fitted.unidentifiable)) < 6, 0.3, 0.0),
    )
    far = evaluate_as_fit(fitted.model, seen, NOISE, off)
    for pair in zip(
        refit_without_folds(far, seen, part),
        refit_without_folds(fitted, seen, part),
        strict=True,
    ):
        errors = [compute_position_residuals(fitted.model, each, seen) for each in pair]
        np.testing.assert_allclose(*errors, atol=1e-3 * NOISE.position_m)


def test_a_refit_that_does_not_converge_is_made_from_nothing(fanuc, monkeypatch):
    fitted, seen = loaded_in(fanuc, np.ones(24, bool))

    def stuck(*given, **options):
        return replace(fitted, converged=False) if options else fit_model(*given)

    monkeypatch.setattr("elastocal.validation.held_out.fit_model", stuck)
    (found,) = next(refit_without_folds(fitted, seen, np.arange(24) // 6)).coefficients
    (from_nothing,) = fit_model(
        fitted.model, select_states(seen, np.arange(24) >= 6), NOISE
    ).estimate.coefficients
    np.testing.assert_array_equal(found, from_nothing)


def test_a_target_that_only_the_part_left_out_shows_is_placed_as_from_nothing(fanuc):
    part = np.arange(24) // 6
    fitted, seen = loaded_in(fanuc, np.ones(24, bool))
    kept = (seen.target != 1) | (part[seen.state] == 2)
    some = replace(
        seen,
        state=seen.state[kept],
        target=seen.target[kept],
        position=seen.position[kept],
    )
    some = replace(
        some, rotation=None if seen.rotation is None else seen.rotation[kept]
    )
    fitted = fit_model(fitted.model, some, NOISE, fitted.estimate)
    refit = list(refit_without_folds(fitted, some, part))[2]
    from_nothing = fit_model(
        fitted.model, select_states(some, part != 2), NOISE
    ).estimate
    np.testing.assert_array_equal(refit.target_offset[1], from_nothing.target_offset[1])
    assert (
        np.abs(refit.target_offset[1] - fitted.estimate.target_offset[1]).max() > 1e-3
    )


def of_sessions(robot, poses=24, sessions=3):
    """A fit with a frame for each session, and its observations."""
    model = make_model(robot.chain, compliance=robot.compliance, identified=True)
    states = make_states(6, poses, seed=1, sessions=sessions)
    estimate = make_estimate(model, tuple(range(sessions)), seed=2)
    estimate = replace(estimate, coefficients=(robot.compliance,))
    seen = add_noise(observe_exactly(model, estimate, states), np.random.default_rng(3))
    return fit_model(model, seen, NOISE), seen


def left_out_errors(fitted, seen, part):
    """Distance of each observation from its prediction by a refit without its part."""
    distances = [
        compute_position_errors(fitted.model, each, seen).distance
        for each in refit_without_folds(fitted, seen, part)
    ]
    return np.choose(np.unique(part, return_inverse=True)[1][seen.state], distances)


def test_errors_are_those_of_a_fit_to_the_rest(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=16)
    seen = campaign.observations
    fitted = campaign.declared
    part = np.arange(16).repeat(2) // 4
    found = left_out_errors(fitted, seen, part)
    for number in range(4):
        rest, left = (
            select_states(seen, mask) for mask in (part != number, part == number)
        )
        refit = fit_model(fitted.model, rest, fitted.noise)
        expected = compute_position_errors(fitted.model, refit.estimate, left).distance
        mask = part[seen.state] == number
        # As near as fits end, of what the rest leaves unsure of the prediction, and
        # that is less than the noise.
        np.testing.assert_allclose(
            found[mask], expected, atol=CONVERGENCE_TOLERANCE * fitted.noise.position_m
        )


def test_refits_to_some_observations_are_those_of_a_fit_to_them(fanuc):
    campaign = planted(fanuc, {"joint_offset@3": [1e-3]}, poses=20)
    seen = campaign.observations
    fitted = campaign.declared
    some = select_states(seen, seen.states.pose < 12)
    part = np.arange(12).repeat(2) // 4
    found = left_out_errors(fitted, some, part)
    expected = left_out_errors(fit_model(fitted.model, some, fitted.noise), some, part)
    np.testing.assert_allclose(found, expected, atol=1e-3 * fitted.noise.position_m)


def test_a_session_left_out_is_placed_by_itself(fanuc):
    fitted, seen = of_sessions(fanuc)
    found = left_out_errors(fitted, seen, seen.states.session)
    assert summarize_errors(found)["rms_m"] == pytest.approx(
        np.sqrt(3) * NOISE.position_m, rel=0.25
    )
