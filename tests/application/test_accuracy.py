"""One definition of accuracy: frames, freedoms that are no errors, what no command
contains, held-out poses, bounds, words."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated, plain_model
from made_folders import made_folder, made_table
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from scipy.stats import chi, norm
from synthetic import made_states

from elastocal.application.accuracy import (
    before_m,
    calibrate_on_case,
    format_accuracy,
    inflate_to_held_out_errors,
    predict_campaign_accuracy,
    predict_errors,
    quantile_of_length,
    scope_of,
)
from elastocal.application.calibrated import predict_poses
from elastocal.application.frames import BASE, ROBOT, Scope, subtract_placement
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.model import apply_step
from elastocal.fitting.noise import Noise
from elastocal.loop.whole import cases_in
from elastocal.mechanics.sites import sites_of
from elastocal.remainder.corrected import is_commanded
from elastocal.validation.held_out import compute_position_residuals
from elastocal.validation.transfer import transfer_fit

LOADED = made_states(6, 60)
STATES = replace(LOADED, wrench=np.zeros((60, 6)))


def set_scope(calibrated, unknown_base):
    model = replace(calibrated.model, fitted_frames=unknown_base)
    scope = scope_of(
        calibrated, model, calibrated.estimate, calibrated.covariance, STATES
    )
    return replace(calibrated, scope=scope, fitted=STATES)


@pytest.mark.parametrize("unknown_base", [False, True])
def test_bounds_hold_95_percent_of_robots_drawn_from_the_covariance(
    fanuc, unknown_base
):
    """Of 150 robots; 90 to 100 % are within nearly three standard errors."""
    calibrated = set_scope(made_calibrated(fanuc, *USUAL), unknown_base)
    angles = calibrated.robot.reported_angles(STATES.joint_angles)
    stated = predict_errors(calibrated, angles, STATES.wrench).accuracy("")
    assert stated.frame == (ROBOT if unknown_base else BASE)
    position, _ = predict_poses(calibrated, angles)
    draws = np.random.default_rng(3)
    root = np.linalg.cholesky(calibrated.covariance)
    rms = []
    worst = []
    for _ in range(150):
        step = root @ draws.standard_normal(len(root))
        other = replace(
            calibrated, estimate=apply_step(calibrated.model, calibrated.estimate, step)
        )
        off = (predict_poses(other, angles)[0] - position)[..., None]
        if unknown_base:
            anywhere = Scope(ROBOT, position.mean(axis=0))
            moved = np.concatenate([off, 0 * off], axis=1)
            off = subtract_placement(anywhere, position, np.zeros((60, 3, 3)), moved)
        distance = np.linalg.norm(off[:, :3, 0], axis=1)
        rms.append(np.sqrt((distance**2).mean()))
        worst.append(distance.max())
    assert np.sqrt(np.mean(np.square(rms))) == pytest.approx(stated.rms_m, rel=0.08)
    assert np.mean(np.array(rms) < stated.rms_bound_m) == pytest.approx(0.95, abs=0.05)
    assert np.mean(np.array(worst) < stated.worst_bound_m) == pytest.approx(
        0.95, abs=0.05
    )


def test_a_misplaced_base_is_no_error_of_the_uncorrected_robot_where_nobody_knows_the_base(
    fanuc,
):
    turned = made_calibrated(fanuc, "joint_offset@1")
    coefficients = (*turned.estimate.coefficients[:-1], np.array([1e-3]))
    value = replace(
        turned, estimate=replace(turned.estimate, coefficients=coefficients)
    )
    angles = value.robot.reported_angles(STATES.joint_angles)
    position, rotation = predict_poses(value, angles)
    nominal = Rotation.from_rotvec([0.0, 0.0, -1e-3]).as_matrix()
    off = np.concatenate(
        [position @ nominal.T - position, np.tile([0.0, 0.0, -1e-3], (60, 1))], axis=1
    )
    known, unknown = (
        before_m(set_scope(value, each), position, rotation, off)
        for each in (False, True)
    )
    np.testing.assert_allclose(
        known, 1e-3 * np.linalg.norm(position[:, :2], axis=1), rtol=1e-2
    )
    # What is left are springs, of which `off` knows nothing.
    assert np.sqrt((unknown**2).mean()) < np.sqrt((known**2).mean())


def test_quantiles_are_those_of_one_and_of_three_directions():
    alike = np.eye(3)
    single = np.diag([1.0, 0.0, 0.0])
    found = quantile_of_length(np.stack([alike, single, np.zeros((3, 3))]))
    np.testing.assert_allclose(
        found, [chi.ppf(0.95, 3), norm.ppf(0.975), 0.0], rtol=1e-12
    )


def scope_with(robot, candidate, values, shapes, std=0.0):
    """Scope of a fit that has one more effect than the robot is commanded by."""
    calibrated = made_calibrated(robot, "joint_offset@2")
    model = plain_model(robot, "joint_offset@2")
    estimate = calibrated.estimate
    model = replace(model, effects=(*calibrated.model.effects, candidate))
    one_more = (
        (*estimate.coefficients, np.array(values)),
        (*estimate.shapes, np.array(shapes, float)),
    )
    estimate = replace(estimate, coefficients=one_more[0], shapes=one_more[1])
    added = (
        np.diag(
            [
                *(std * p.plausible for p in candidate.parameters),
                *(0.0 for _ in candidate.shapes),
            ]
        )
        ** 2
    )
    return scope_of(
        calibrated, model, estimate, block_diag(calibrated.covariance, added), LOADED
    )


def test_every_effect_that_no_command_contains_counts_as_error(fanuc):
    found = {
        key: candidate
        for key, candidate in candidates_on(sites_of(fanuc)).items()
        if not is_commanded(candidate)
    }
    instruments = {"frame_drift", "tracker_scale", "force_bias"}
    unstated = {"hysteresis", "thermal_growth", "temperature_gradient"}
    assert {candidate.effect for candidate in found.values()} >= {
        "setup_step",
        *instruments,
        *unstated,
    }
    # The first one of each effect.
    for key, candidate in {
        candidate.effect: (key, candidate) for key, candidate in reversed(found.items())
    }.values():
        values = [p.plausible for p in candidate.parameters]
        shapes = [0.5 * (s.lowest + s.highest) for s in candidate.shapes]
        scope = scope_with(fanuc, candidate, values, shapes)
        assert (
            scope.left_out == (key,)
            and scope.left_out_worst_m >= scope.left_out_m > 1e-7
        ), key
        # One that is fitted to nothing is as uncertain as it is.
        unsure = scope_with(fanuc, candidate, np.zeros(len(values)), shapes, std=1.0)
        assert unsure.left_out_m > 0.1 * scope.left_out_m, key


def test_an_unknown_offset_of_the_target_at_the_end_effector_is_no_error(fanuc):
    calibrated = made_calibrated(fanuc, "link_geometry@6")
    target = calibrated.model.targets[0]
    sizes = []
    for stated in ((0.0, 0.0, 0.0), None):
        model = replace(calibrated.model, targets=(replace(target, offset_m=stated),))
        scope = scope_of(
            calibrated, model, calibrated.estimate, calibrated.covariance, LOADED
        )
        variances = [0.0] * (len(calibrated.covariance) - 6) + [1e-3] * 3 + [0.0] * 3
        known = replace(
            calibrated, scope=scope, covariance=np.diag(variances), fitted=LOADED
        )
        sizes.append(predict_campaign_accuracy(known).rms_m)
        assert scope.offset_removed == (stated is None)
    assert sizes[1] < 1e-3 * sizes[0]


@pytest.fixture(scope="module")
def campaign(kuka, tmp_path_factory, config_folder):
    folder = made_folder(
        tmp_path_factory.mktemp("judged") / "made", kuka, table=made_table(kuka, "made")
    )
    case, held_out = cases_in(folder, config_folder / "robots")
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    final = fit_model(case.model, case.observations, noise)
    return (
        case,
        held_out,
        final,
        calibrate_on_case(case, final.model, final.estimate, final.covariance, noise),
    )


def judged(calibrated, final, case, held_out):
    residual = compute_position_residuals(
        *transfer_fit(final, case, held_out), held_out.observations
    )
    return inflate_to_held_out_errors(
        calibrated, held_out, residual, final.noise.position_m
    )


def test_held_out_poses_that_were_missed_by_more_raise_what_is_predicted_to_that_where_the_noise_is_known(
    campaign,
):
    case, held_out, final, calibrated = campaign
    assert judged(calibrated, final, case, held_out) is calibrated
    seen = held_out.observations
    moved = replace(
        held_out,
        observations=replace(seen, position=seen.position + np.array([1e-3, 0.0, 0.0])),
    )
    stated = predict_campaign_accuracy(judged(calibrated, final, case, moved))
    assert stated.contradicted and stated.rms_m == pytest.approx(1e-3, rel=0.1)
    unknown = replace(calibrated, noise=replace(calibrated.noise, source="residual"))
    assert judged(unknown, final, case, moved) is unknown


def test_repeats_tell_how_well_joints_repeat_though_the_sensor_hides_each(campaign):
    case, _, final, _ = campaign
    noise = replace(final.noise, source="repeats")
    found = calibrate_on_case(
        case, final.model, final.estimate, final.covariance, noise
    )
    # None moves here: what is left possible is what these repeats do not show.
    assert (
        0.0 < found.noise.joint_rad[0] < 6e-5 and np.ptp(found.noise.joint_rad) == 0.0
    )


def test_of_a_robot_of_which_nothing_was_fitted_no_error_of_zero_is_predicted(fanuc):
    calibrated = made_calibrated(fanuc, relative_std=0.0)
    found = predict_errors(calibrated, *np.zeros((2, 3, 6))).accuracy("some poses")
    assert found.rms_m == 0.0 and not found.fitted
    assert "nothing of the robot was fitted" in format_accuracy(
        found
    ) and "0.000" not in format_accuracy(found)
    # What the form of the model leaves open is in every figure.
    contradicted = replace(
        calibrated, scope=replace(calibrated.scope, form_m=1e-3, contradicted=True)
    )
    open_form = predict_errors(contradicted, *np.zeros((2, 3, 6)))
    stated = open_form.accuracy("some poses")
    assert (
        stated.rms_m == pytest.approx(1e-3, rel=0.01)
        and min(stated.rms_bound_m, stated.worst_m) > 1e-3
    )
    assert (open_form.bound_m > 1e-3).all() and "1.000 mm" in format_accuracy(stated)
