"""A corrected path as a library user has it: its status, table and warnings."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import analysed
from made_calibrated import make_calibrated_robot
from scipy.spatial.transform import Rotation
from synthetic import make_states

from elastocal.application.calibrated import (
    ResidualModel,
    build_observations,
    compute_nominal_poses,
    compute_pose_sensitivities,
    predict_poses,
)
from elastocal.application.path_correction import (
    correct_path,
    describe_path_accuracy,
    describe_path_warnings,
    describe_program,
    tabulate_targets,
)
from elastocal.errors import InputError
from elastocal.exchange.target_path import TargetPath
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.residual_model.regressions import REGRESSIONS
from elastocal.residual_model.selection import build_inputs

POSE = ["x", "y", "z", "rx", "ry", "rz"]
# Angles from the middle of the limits to a posture that is not singular.
BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


@pytest.fixture(scope="module")
def calibrated():
    """A robot that was fitted in states all around the path."""
    calibrated = make_calibrated_robot(analysed("gp180"), "joint_offset@2")
    middle = calibrated.robot.joint_limits.mean(axis=1) + BENT
    states = make_states(6, 60)
    angles = middle + np.linspace(-0.5, 0.5, 60)[:, None]
    return replace(calibrated, fitted=replace(states, joint_angles=angles))


def make_path(calibrated, steps):
    robot = calibrated.robot
    angles = robot.joint_limits.mean(axis=1) + BENT + np.array(steps)[:, None]
    commands = robot.reported_angles(angles)
    position, rotation = compute_nominal_poses(robot, commands)
    lines = tuple(range(2, 2 + len(steps)))
    return TargetPath(position, rotation, commands, None, lines)


def test_targets_within_the_fitted_range_have_a_bound(calibrated):
    path = correct_path(calibrated, make_path(calibrated, [0.0, 0.02]), "path.csv")
    assert path.has_bound.all() and not path.is_extrapolated.any()
    assert describe_path_warnings(path) == []
    table = tabulate_targets(path)
    assert table["status"].tolist() == ["ok", "ok"]
    assert (table["predicted_error_after_m"] < table["predicted_bound_m"]).all()
    assert "over the targets (2)" in describe_path_accuracy(path)[0]
    assert "load: none beside what the robot file states" in describe_program(path, "c")


def test_targets_beyond_the_fitted_range_have_no_bound(calibrated):
    path = correct_path(calibrated, make_path(calibrated, [0.4, 0.7]), "path.csv")
    assert path.has_bound.tolist() == [True, False]
    assert np.isnan(tabulate_targets(path)["predicted_bound_m"][1])
    no_bound, extrapolated = describe_path_warnings(path)
    assert "no bound is stated for 1 of 2 targets" in no_bound
    assert "1 of 2 targets lie beyond the poses or loads" in extrapolated
    assert "the targets with a bound (1)" in describe_path_accuracy(path)[0]


def test_an_unreachable_pose_is_refused_with_its_line(calibrated):
    wanted = make_path(calibrated, [0.0, 0.02])
    wanted.position[1] *= 5.0
    with pytest.raises(InputError, match=r"path\.csv: found line 3 is unreachable"):
        correct_path(calibrated, wanted, "path.csv")


def test_the_other_poses_of_a_path_are_corrected_if_the_user_wants_them(calibrated):
    wanted = make_path(calibrated, [0.0, 0.02, 0.04])
    wanted.position[1] *= 5.0
    path = correct_path(calibrated, wanted, "path.csv", partial=True)
    assert path.share == "2 of 3 targets"
    assert "line 3 is unreachable" in describe_path_warnings(path)[0]
    table = tabulate_targets(path)
    assert table["status"].tolist() == ["ok", "unreachable", "ok"]
    errors_and_angles = table.drop(columns=["status", *POSE, *WRENCH_NAMES])
    assert errors_and_angles.isna().all(axis=1).tolist() == [False, True, False]
    np.testing.assert_allclose(table[["x", "y", "z"]], wanted.position)
    others = make_path(calibrated, [0.0, 0.04])
    np.testing.assert_array_equal(
        table.iloc[[0, 2]].drop(columns="status").to_numpy(float),
        tabulate_targets(correct_path(calibrated, others, "path.csv"))
        .drop(columns="status")
        .to_numpy(float),
    )


def test_a_path_without_a_pose_that_is_reached_is_refused(calibrated):
    wanted = make_path(calibrated, [0.0, 0.02])
    wanted.position[:] *= 5.0
    with pytest.raises(InputError, match="line 2 is unreachable, line 3"):
        correct_path(calibrated, wanted, "path.csv", partial=True)


def test_the_orientation_error_before_is_that_of_the_uncorrected_targets(calibrated):
    path = correct_path(calibrated, make_path(calibrated, [0.0, 0.02]), "path.csv")
    table = tabulate_targets(path)
    uncorrected = table[[f"q{joint}_uncorrected" for joint in range(1, 7)]].to_numpy()
    _, rotation = predict_poses(calibrated, uncorrected)
    turn = Rotation.from_matrix(rotation.swapaxes(1, 2) @ path.wanted.rotation)
    np.testing.assert_allclose(
        table["predicted_orientation_error_before_rad"], turn.magnitude(), rtol=1e-6
    )
    assert "predicted orientation error there" in describe_path_accuracy(path)[2]


def test_the_orientation_error_after_is_that_of_robots_which_the_fit_allows(calibrated):
    """Power: a wrong factor of 1.2 differs by four standard errors of 400 robots."""
    path = correct_path(calibrated, make_path(calibrated, [0.0]), "path.csv")
    stream = np.random.default_rng(5)
    factor = np.linalg.cholesky(
        calibrated.covariance + 1e-30 * np.eye(len(calibrated.covariance))
    )
    columns = compute_pose_sensitivities(
        calibrated, path.correction.joint_angles, path.wrench
    )
    draws = columns[0, 3:] @ factor @ stream.standard_normal((len(factor), 400))
    expected = np.sqrt((draws**2).sum(axis=0).mean())
    repeats = calibrated.noise.joint_rad
    assert not np.any(repeats)
    assert path.prediction.orientation_rad[0] == pytest.approx(expected, rel=0.15)


def test_a_correction_that_makes_orientations_less_certain_is_a_warning(calibrated):
    wanted = make_path(calibrated, [0.0, 0.02])
    warning = "measure orientations, or several reflectors"
    path = correct_path(calibrated, wanted, "path.csv")
    assert not any(warning in text for text in describe_path_warnings(path))
    vague = replace(calibrated, covariance=1e8 * calibrated.covariance)
    path = correct_path(vague, wanted, "path.csv")
    assert any(warning in text for text in describe_path_warnings(path))


@pytest.mark.parametrize("name", list(REGRESSIONS))
def test_a_path_beyond_the_range_of_a_regression_is_corrected_by_the_physics(
    calibrated, name
):
    """No target lies where the regression acts."""
    fitted = build_observations(calibrated.states)
    inputs = build_inputs(calibrated.model, calibrated.estimate, fitted)
    residual = 1e-4 * np.sin(3.0 * inputs.joint_angles[:, :3])
    regression = REGRESSIONS[name]
    predictor = next(regression.fit(inputs, residual, regression.settings[:1], 1))
    regressed = replace(
        calibrated, residual_model=ResidualModel(predictor, np.zeros(3), 2e-5, 1.0)
    )
    wanted = make_path(calibrated, [0.7, 0.72])
    path = correct_path(regressed, wanted, "path.csv")
    physics = correct_path(calibrated, wanted, "path.csv")
    np.testing.assert_array_equal(
        path.correction.joint_angles, physics.correction.joint_angles
    )
