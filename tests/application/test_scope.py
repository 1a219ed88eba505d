"""What counts as error of a fit: all that no command contains, and what held-out poses say."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import made_calibrated, plain_model
from made_folders import made_folder, made_table
from scipy.linalg import block_diag
from synthetic import made_states

from elastocal.application.accuracy import BASE, ROBOT, predict_errors
from elastocal.application.calibrated import moves_robot
from elastocal.application.scope import calibrate_on_case, campaign_accuracy, conditions_in, judge_by_held_out, scope_of
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit
from elastocal.fitting.noise import Noise
from elastocal.loop.whole import cases_in
from elastocal.mechanics.sites import sites_of

STATES = made_states(6, 60)


def scope_with(robot, candidate, values, shapes, unknown_base=False, std=0.0):
    """Scope of a fit that has one more effect than the robot is commanded by."""
    calibrated = made_calibrated(robot, "joint_offset@2")
    model = replace(
        plain_model(robot, "joint_offset@2"), effects=(*calibrated.model.effects, candidate), fitted_frames=unknown_base
    )
    estimate = calibrated.estimate
    estimate = replace(
        estimate, coefficients=(*estimate.coefficients, np.array(values)), shapes=(*estimate.shapes, np.array(shapes, float))
    )
    added = np.diag([*(std * p.plausible for p in candidate.parameters), *(0.0 for _ in candidate.shapes)]) ** 2
    frame = np.zeros((6, 6)) if unknown_base else np.zeros((0, 0))
    return scope_of(calibrated, model, estimate, block_diag(frame, calibrated.covariance, added), STATES)


def all_that_leave_the_robot_alone(robot):
    return {key: candidate for key, candidate in candidates_on(sites_of(robot)).items() if not moves_robot(candidate)}


def test_every_effect_that_no_command_contains_counts_as_error(fanuc):
    found = all_that_leave_the_robot_alone(fanuc)
    assert {candidate.effect for candidate in found.values()} >= {"setup_step", "frame_drift", "tracker_scale", "force_bias"}
    # The last one of each effect.
    for key, candidate in {candidate.effect: (key, candidate) for key, candidate in found.items()}.values():
        values, shapes = [p.plausible for p in candidate.parameters], [0.5 * (s.lowest + s.highest) for s in candidate.shapes]
        scope = scope_with(fanuc, candidate, values, shapes)
        assert scope.left_out == (key,) and scope.left_out_worst_m >= scope.left_out_m > 1e-7, key
        # One that is fitted to nothing is as uncertain as it is.
        unsure = scope_with(fanuc, candidate, np.zeros(len(values)), shapes, std=1.0)
        assert unsure.left_out_m > 0.1 * scope.left_out_m, key


def test_a_step_counts_as_all_of_it_in_the_base_frame_and_as_what_no_placement_takes_up_in_the_robots_own(fanuc):
    step = all_that_leave_the_robot_alone(fanuc)["setup_step"]
    values = [1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]
    whole, half = ([scope_with(fanuc, step, values, [when], unknown) for unknown in (False, True)] for when in (0.0, 0.5))
    assert (whole[0].frame, whole[1].frame) == (BASE, ROBOT)
    assert [each.left_out_m for each in whole] == pytest.approx([1e-3, 0.0], abs=1e-9)
    assert half[0].left_out_m == pytest.approx(1e-3, rel=1e-6)
    assert 2e-4 < half[1].left_out_m <= 5.1e-4


def test_what_goes_with_a_condition_counts_as_error_where_a_command_does_not_state_it(fanuc):
    calibrated = made_calibrated(fanuc, "joint_offset@2", "temperature_gradient@2[temperature]")
    scope = scope_of(calibrated, calibrated.model, calibrated.estimate, calibrated.covariance, STATES)
    known, angles = replace(calibrated, scope=scope), calibrated.robot.reported_angles(STATES.joint_angles)
    names, there = [name for name, _, _ in scope.unstated], conditions_in(known, STATES)
    assert names and set(names) <= {"time", "temperature"} and scope.left_out_m == 0.0
    stated, unstated = (predict_errors(known, angles, each) for each in (there, replace(there, temperature_c=None)))
    assert not stated.accuracy("").left_out and "not given" in unstated.accuracy("").left_out[0]
    assert unstated.accuracy("").left_out_m == pytest.approx(np.linalg.norm([rms for _, rms, _ in scope.unstated]))
    assert unstated.accuracy("").rms_m > stated.accuracy("").rms_m


def test_an_unknown_offset_of_the_target_at_the_end_effector_is_no_error(fanuc):
    calibrated = made_calibrated(fanuc, "link_geometry@6")
    target = calibrated.model.targets[0]
    sizes = []
    for stated in ((0.0, 0.0, 0.0), None):
        model = replace(calibrated.model, targets=(replace(target, offset_m=stated),))
        scope = scope_of(calibrated, model, calibrated.estimate, calibrated.covariance, STATES)
        variances = [0.0] * (len(calibrated.covariance) - 6) + [1e-3] * 3 + [0.0] * 3
        known = replace(calibrated, scope=scope, covariance=np.diag(variances))
        sizes.append(campaign_accuracy(known, STATES).rms_m)
        assert scope.offset_removed == (stated is None)
    assert sizes[1] < 1e-3 * sizes[0]


@pytest.fixture(scope="module")
def campaign(kuka, tmp_path_factory, config_folder):
    folder = made_folder(tmp_path_factory.mktemp("judged") / "made", kuka, table=made_table(kuka, "made"))
    case, held_out = cases_in(folder, config_folder / "robots")
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    final = fit(case.model, case.observations, noise)
    return case, held_out, final, calibrate_on_case(case, final.model, final.estimate, final.covariance, noise)


def test_held_out_poses_that_agree_change_nothing(campaign):
    case, held_out, final, calibrated = campaign
    assert judge_by_held_out(calibrated, final, case, held_out) is calibrated


def test_held_out_poses_that_were_missed_by_more_raise_what_is_predicted_to_that_where_the_noise_is_known(campaign):
    case, held_out, final, calibrated = campaign
    seen = held_out.observations
    moved = replace(held_out, observations=replace(seen, position=seen.position + np.array([1e-3, 0.0, 0.0])))
    found = judge_by_held_out(calibrated, final, case, moved)
    stated = campaign_accuracy(found, case.observations.states)
    assert stated.contradicted and stated.rms_m == pytest.approx(1e-3, rel=0.1)
    unknown = replace(final, noise=replace(final.noise, source="residual"))
    assert judge_by_held_out(calibrated, unknown, case, moved) is calibrated


def test_repeats_tell_how_well_joints_repeat_though_the_sensor_hides_each(campaign):
    case, _, final, _ = campaign
    noise = replace(final.noise, source="repeats")
    found = calibrate_on_case(case, final.model, final.estimate, final.covariance, noise)
    # None moves here: what is left possible is what these repeats do not show.
    assert 0.0 < found.noise.joint_rad[0] < 6e-5 and np.ptp(found.noise.joint_rad) == 0.0
