"""One definition of accuracy: frames, freedoms that are no errors, bounds, words."""

from dataclasses import replace

import numpy as np
import pytest
from made_calibrated import USUAL, made_calibrated
from scipy.spatial.transform import Rotation
from synthetic import made_states

from elastocal.application.accuracy import (
    BASE,
    ROBOT,
    accuracy_from,
    accuracy_sentence,
    before_m,
    predict_errors,
    remove_rigid_motion,
    scope_from,
)
from elastocal.application.calibrated import NEUTRAL, forward
from elastocal.application.scope import scope_of
from elastocal.fitting.parameters import stepped

STATES = replace(made_states(6, 60), wrench=np.zeros((60, 6)))


def set_scope(calibrated, unknown_base):
    model = replace(calibrated.model, fitted_frames=unknown_base)
    return replace(calibrated, scope=scope_of(calibrated, model, calibrated.estimate, calibrated.covariance, STATES))


@pytest.fixture(scope="module")
def turned(fanuc):
    """A robot of which nothing is unknown but where its first axis starts to count: as if its base were turned."""
    found = made_calibrated(fanuc, "joint_offset@1", relative_std=0.3)
    covariance = np.zeros_like(found.covariance)
    covariance[-1, -1] = 1e-3**2
    return replace(found, covariance=covariance)


def test_what_a_placement_of_the_base_takes_up_is_an_error_in_the_base_frame_alone(turned):
    angles = np.random.default_rng(2).uniform(-1, 1, (1, 6))
    position, _ = forward(turned, angles)
    base, robot = (predict_errors(set_scope(turned, unknown), angles, NEUTRAL) for unknown in (False, True))
    assert base.error_m[0] == pytest.approx(1e-3 * np.linalg.norm(position[0, :2]), rel=1e-3)
    assert robot.error_m[0] < 1e-3 * base.error_m[0]
    assert (base.accuracy("").frame, robot.accuracy("").frame) == (BASE, ROBOT)


@pytest.mark.parametrize("unknown_base", [False, True])
def test_bounds_hold_95_percent_of_robots_drawn_from_the_covariance(fanuc, unknown_base):
    """Of 150 robots; 90 to 100 % are within nearly three standard errors."""
    calibrated = set_scope(made_calibrated(fanuc, *USUAL), unknown_base)
    angles = calibrated.robot.reported_angles(STATES.joint_angles)
    stated = predict_errors(calibrated, angles, NEUTRAL).accuracy("")
    position, _ = forward(calibrated, angles)
    draws, root = np.random.default_rng(3), np.linalg.cholesky(calibrated.covariance)
    rms, worst = [], []
    for _ in range(150):
        step = root @ draws.standard_normal(len(root))
        other = replace(calibrated, estimate=stepped(calibrated.model, calibrated.estimate, step))
        off = forward(other, angles)[0] - position
        distance = np.linalg.norm(remove_rigid_motion(off, position) if unknown_base else off, axis=1)
        rms.append(np.sqrt((distance**2).mean()))
        worst.append(distance.max())
    assert np.sqrt(np.mean(np.square(rms))) == pytest.approx(stated.rms_m, rel=0.08)
    assert np.mean(np.array(rms) < stated.rms_bound_m) == pytest.approx(0.95, abs=0.05)
    assert np.mean(np.array(worst) < stated.worst_bound_m) == pytest.approx(0.95, abs=0.05)


def test_what_the_form_of_the_model_leaves_open_is_in_every_figure(turned):
    angles = np.random.default_rng(2).uniform(-1, 1, (5, 6))
    known = set_scope(turned, True)
    found = predict_errors(replace(known, scope=replace(known.scope, form_m=1e-3)), angles, NEUTRAL)
    assert found.accuracy("").rms_m == pytest.approx(1e-3, rel=0.01)
    assert found.accuracy("").rms_bound_m > 1e-3 and found.accuracy("").worst_m > 1e-3 and (found.bound_m > 1e-3).all()
    assert "form of the model" in accuracy_sentence(found.accuracy("some poses"))


def test_a_misplaced_base_is_no_error_of_the_uncorrected_robot_where_nobody_knows_the_base(turned):
    coefficients = (*turned.estimate.coefficients[:-1], np.array([1e-3]))
    value = replace(turned, estimate=replace(turned.estimate, coefficients=coefficients))
    angles = value.robot.reported_angles(STATES.joint_angles)
    position, rotation = forward(value, angles)
    nominal = Rotation.from_rotvec([0.0, 0.0, -1e-3]).as_matrix()
    off = np.concatenate([position @ nominal.T - position, np.tile([0.0, 0.0, -1e-3], (60, 1))], axis=1)
    known, unknown = (before_m(set_scope(value, each), position, rotation, off) for each in (False, True))
    np.testing.assert_allclose(known, 1e-3 * np.linalg.norm(position[:, :2], axis=1), rtol=1e-2)
    # What is left are springs, of which `off` knows nothing.
    assert np.sqrt((unknown**2).mean()) < np.sqrt((known**2).mean())


def test_statements_and_scopes_come_back_from_json(turned):
    known = set_scope(turned, True)
    accuracy = predict_errors(known, np.zeros((1, 6)), NEUTRAL).accuracy("one pose")
    assert accuracy_from(accuracy.document()) == accuracy
    back = scope_from(known.scope.document())
    np.testing.assert_array_equal(back.absorbed, known.scope.absorbed)
    one, other = (replace(each, origin=0, absorbed=0, absorbed_before=0) for each in (back, known.scope))
    assert one == other
