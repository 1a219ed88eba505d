"""The scope of a fit: effects that no command contains count as errors, motions that
nobody can know do not."""

from dataclasses import replace

import numpy as np
import pytest
from contact_campaigns import (
    build_contact_case,
    fit_contacts,
    open_workshop,
    spread_places,
    write_contacts,
)
from made_calibrated import make_calibrated_robot, plain_model
from made_folders import make_folder, make_table
from scipy.linalg import block_diag
from synthetic import make_states

from elastocal.application.accuracy import (
    predict_campaign_accuracy,
    predict_errors,
)
from elastocal.application.frames import ROBOT
from elastocal.application.scope import calibrate_on_case, determine_scope
from elastocal.effects.catalogue import candidates_on
from elastocal.fitting.least_squares import fit_model
from elastocal.fitting.noise import Noise
from elastocal.loop.whole import read_cases
from elastocal.mechanics.sites import build_sites
from elastocal.residual_model.selection import is_commanded
from elastocal_proof.plant.contacts import seat_in_socket

STATES = make_states(6, 60)


def scope_with(robot, candidate, values, shapes, std=0.0):
    """Scope of a fit that has one more effect than the robot is commanded by.

    `std` is the standard deviation of its parameters in units of their plausible sizes.
    """
    calibrated = make_calibrated_robot(robot, "joint_offset@2")
    model = plain_model(robot, "joint_offset@2")
    model = replace(model, effects=(*calibrated.model.effects, candidate))
    estimate = replace(
        calibrated.estimate,
        coefficients=(*calibrated.estimate.coefficients, np.array(values)),
        shapes=(*calibrated.estimate.shapes, np.array(shapes, float)),
    )
    deviations = [std * parameter.plausible for parameter in candidate.parameters]
    deviations += [0.0 for _ in candidate.shapes]
    covariance = block_diag(calibrated.covariance, np.diag(deviations) ** 2)
    return determine_scope(calibrated, model, estimate, covariance, STATES)


def left_out_m(calibrated, scope):
    """RMS errors by the effects that no command contains, at the campaign's poses, m."""
    commands = calibrated.robot.reported_angles(STATES.joint_angles)
    calibrated = replace(calibrated, scope=scope)
    return predict_errors(calibrated, commands, STATES.wrench, draws=0).left_out_m


def test_every_effect_that_no_command_contains_counts_as_error(fanuc):
    calibrated = make_calibrated_robot(fanuc, "joint_offset@2")
    first_of_effect = {}
    for key, candidate in candidates_on(build_sites(fanuc)).items():
        if not is_commanded(candidate):
            first_of_effect.setdefault(candidate.effect, (key, candidate))
    instruments = {"frame_drift", "tracker_scale", "force_bias"}
    conditions = {"hysteresis", "thermal_growth", "temperature_gradient"}
    assert first_of_effect.keys() >= {"setup_step", *instruments, *conditions}
    for key, candidate in first_of_effect.values():
        values = [parameter.plausible for parameter in candidate.parameters]
        shapes = [0.5 * (shape.lowest + shape.highest) for shape in candidate.shapes]
        scope = scope_with(fanuc, candidate, values, shapes)
        assert scope.left_out == (key,), key
        rms_m = np.sqrt((left_out_m(calibrated, scope) ** 2).mean())
        assert rms_m > 1e-7, key
        # An effect that was fitted to zero still contributes its uncertainty.
        zeros = np.zeros(len(values))
        uncertain = scope_with(fanuc, candidate, zeros, shapes, std=1.0)
        uncertain_m = np.sqrt((left_out_m(calibrated, uncertain) ** 2).mean())
        assert uncertain_m > 0.1 * rms_m, key


def test_an_unknown_offset_of_the_target_at_the_end_effector_is_no_error(fanuc):
    calibrated = make_calibrated_robot(fanuc, "link_geometry@6")
    target = calibrated.model.targets[0]
    variances = [0.0] * (len(calibrated.covariance) - 6) + [1e-3] * 3 + [0.0] * 3
    sizes = []
    for offset_m in ((0.0, 0.0, 0.0), None):
        model = replace(calibrated.model, targets=(replace(target, offset_m=offset_m),))
        scope = determine_scope(
            calibrated, model, calibrated.estimate, calibrated.covariance, STATES
        )
        assert scope.offset_removed == (offset_m is None)
        uncertain = replace(
            calibrated, scope=scope, covariance=np.diag(variances), fitted=STATES
        )
        sizes.append(predict_campaign_accuracy(uncertain).rms_m)
    size_if_known, size_if_unknown = sizes
    assert size_if_unknown < 1e-3 * size_if_known


@pytest.fixture(scope="module")
def case(kuka, tmp_path_factory, config_folder):
    folder = tmp_path_factory.mktemp("repeated") / "made"
    folder = make_folder(folder, kuka, table=make_table(kuka, "made"))
    return read_cases(folder, config_folder / "robots")[0]


def test_repeats_bound_the_repeatability_of_joints_that_the_sensor_hides(case):
    noise = Noise("declared", 6e-5, 6e-5, np.zeros(6))
    fit = fit_model(case.model, case.observations, noise)
    calibrated = calibrate_on_case(
        case, fit.model, fit.estimate, fit.covariance, replace(noise, source="repeats")
    )
    # No joint moves between these repeats, so the repeatability is what they do not rule
    # out, and the same for all joints.
    joint_rad = calibrated.noise.joint_rad
    assert 0.0 < joint_rad[0] < 6e-5 and np.ptp(joint_rad) == 0.0


def test_a_robot_that_touched_sockets_is_corrected_without_them_and_without_a_base(
    tmp_path,
):
    workshop = open_workshop(3)
    places = spread_places(workshop, 3)
    rows = []
    for row in range(45):
        seat = seat_in_socket(workshop, places[row % 3], 5e-5)
        rows.append({"angles": seat, "feature": f"socket{row % 3}"})
    features = {f"socket{number}": {} for number in range(3)}
    document = {"measured": "point", "features": features}
    document["noise"] = {"position_m": 5e-5}
    folder = write_contacts(tmp_path / "cell", document, rows)
    fitted = fit_contacts(folder)
    case = build_contact_case(folder)
    robot = calibrate_on_case(
        case, fitted.model, fitted.estimate, fitted.covariance, fitted.noise
    )
    assert robot.model.measuring is None
    # Sockets anywhere say nothing of the base.
    assert robot.scope.frame == ROBOT
    states = case.observations.states
    errors = predict_errors(robot, states.joint_angles, states.wrench)
    assert (errors.error_m > 0.0).all()
    # What was fitted is what was touched: residuals are those of the contacts.
    observed = robot.fit.observations
    assert observed.channel is None
    assert observed.position.shape == (len(observed), 3)
    for number in range(3):
        members = case.observations.channel == number
        scatter = observed.position[members].std(axis=0)
        np.testing.assert_allclose(scatter, 0.0, atol=1e-12)
