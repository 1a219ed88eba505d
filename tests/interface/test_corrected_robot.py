import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.spatial.transform import Rotation

import elastocal as ec
from elastocal.io.typed_json import to_document
from elastocal.mechanics.kinematics import compute_poses

ROTATION = ["rx", "ry", "rz"]


@pytest.fixture
def commands(nominal):
    return np.random.default_rng(2).uniform(-1.0, 1.0, (6, nominal.joints))


def wanted_poses(nominal, commands):
    """Poses that the nominal robot reaches at commands, and these as postures."""
    position, rotation = compute_poses(
        nominal.chain, commands, nominal.chain.end_effector
    )
    vectors = Rotation.from_matrix(rotation).as_rotvec()
    names = [*"xyz", *ROTATION, *(f"q{j}" for j in range(1, nominal.joints + 1))]
    return pd.DataFrame(np.column_stack([position, vectors, commands]), columns=names)


def test_corrected_commands_reach_the_wanted_poses(result, nominal, commands):
    table = wanted_poses(nominal, commands)
    corrected = result.robot.correct(table)
    angles = corrected.table[[f"q{j}" for j in range(1, nominal.joints + 1)]]
    position, _ = result.robot.predict(angles.to_numpy())
    np.testing.assert_allclose(position, table[[*"xyz"]], atol=1e-9)


def test_commands_move_by_the_wrong_zero(result, nominal, commands):
    corrected = result.robot.correct(wanted_poses(nominal, commands))
    shift = corrected.correction.joint_angles - commands
    np.testing.assert_allclose(shift[:, 1], -2e-3, atol=3e-4)


def test_a_file_gives_the_same_commands_as_a_table(result, nominal, commands, tmp_path):
    table = wanted_poses(nominal, commands)
    path = tmp_path / "path.csv"
    table.to_csv(path, index=False)
    pd.testing.assert_frame_equal(
        result.robot.correct(path).table, result.robot.correct(table).table
    )


def test_predicted_error_covers_the_true_one(result, nominal, commands):
    """The faulty robot's second joint is off by 2 mrad."""
    prediction = result.robot.predict_errors(commands)
    true_angles = commands + np.eye(nominal.joints)[1] * 2e-3
    true_position, _ = compute_poses(
        nominal.chain, true_angles, nominal.chain.end_effector
    )
    position, _ = result.robot.predict(commands)
    distance = np.linalg.norm(position - true_position, axis=1)
    assert (distance <= prediction.bound_m).all()


def test_certificate_passes_a_wide_tolerance_and_fails_a_narrow_one(result):
    assert result.robot.certify(1e-3).decision == "pass"
    assert result.robot.certify(1e-7).decision == "fail"


def test_robot_file_holds_the_wrong_zero(result, nominal, commands, tmp_path):
    path = tmp_path / "arm.yaml"
    assert result.robot.to_robot_file(path) == ()
    exported = ec.read_robot(path)
    position, _ = compute_poses(
        exported.chain, exported.model_angles(commands), exported.chain.end_effector
    )
    np.testing.assert_allclose(position, result.robot.predict(commands)[0], atol=1e-9)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (pd.DataFrame({"x": [0.0]}), "no column 'y'"),
        (
            pd.DataFrame(np.full((1, 6), np.nan), columns=[*"xyz", *ROTATION]),
            "row 1, column x",
        ),
    ],
)
def test_a_wrong_path_is_refused_in_one_line(result, table, message):
    with pytest.raises(ec.InputError, match=message):
        result.robot.correct(table)


@pytest.mark.parametrize("seed", ["a", -1])
def test_a_wrong_seed_is_refused(campaign, seed):
    with pytest.raises(ec.InputError, match="diagnose: seed"):
        ec.diagnose(campaign, seed=seed)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda robot, path: robot.correct(None), "correct: path"),
        (lambda robot, path: robot.correct(path[:0]), "path: found no row"),
        (lambda robot, path: robot.correct(path.assign(x="a")), "path: x..rz"),
        (lambda robot, path: robot.correct(path.drop(columns="q2")), "no column 'q2'"),
        (lambda robot, path: robot.certify("0.2mm"), "certify: tolerance_m"),
        (lambda robot, path: ec.certify(path, 1e-3), "certify: robot"),
        (lambda robot, path: robot.verify(None, np.zeros((6, 3))), "verify: targets"),
        (lambda robot, path: ec.verify(None, path, path), "verify: robot"),
        (lambda robot, path: ec.read_model("no.json"), "no.json: found no such file"),
        (lambda robot, path: ec.read_verdict("no.json"), "no.json: found no such file"),
    ],
)
def test_a_wrong_argument_is_named(result, nominal, commands, call, message):
    with pytest.raises(ec.InputError) as caught:
        call(result.robot, wanted_poses(nominal, commands))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_force_along_one_axis_is_a_load(result, nominal, commands):
    path = wanted_poses(nominal, commands).assign(fz=-50.0)
    wrench = result.robot.correct(path).wrench
    np.testing.assert_array_equal(wrench, [[0, 0, -50, 0, 0, 0]] * len(path))


def test_robot_path_and_verification_are_shown_in_a_line(result, nominal, commands):
    """Wanted positions in place of measured ones: errors of zero, without any noise."""
    path = wanted_poses(nominal, commands)
    corrected = result.robot.correct(path)
    verified = result.robot.verify(corrected, path[[*"xyz"]])
    for shown, start in (
        (result.robot, "<CorrectedRobot test arm: joint_offset; predicted error 0."),
        (corrected, "<CorrectedPath: 6 targets; predicted position error "),
        (verified, "<Verification of 6 targets: RMS position error before "),
    ):
        assert str(shown).startswith(start)
        assert "\n" not in str(shown)
    assert "measured 0.000 mm; the prediction held" in str(verified)


def test_a_robot_without_a_bound_is_shown_without_one(result):
    accuracy = replace(result.robot.verdict.accuracy, rms_bound_m=None)
    verdict = replace(result.robot.verdict, accuracy=accuracy)
    assert str(replace(result.robot, verdict=verdict)).endswith(" mm RMS>")


def test_a_folder_that_is_missing_is_named_with_the_file(result, tmp_path):
    path = tmp_path / "none" / "arm.json"
    with pytest.raises(FileNotFoundError) as caught:
        result.robot.save(path)
    assert str(caught.value).endswith(f"'{path}'")


def test_commands_of_another_number_of_joints_are_refused(result):
    with pytest.raises(ec.InputError, match="joint_angles"):
        result.robot.predict(np.zeros((2, 5)))
    with pytest.raises(ec.InputError, match="wrenches"):
        result.robot.predict(np.zeros((2, 6)), np.zeros((3, 6)))


@pytest.fixture(scope="module")
def read_again(result, tmp_path_factory):
    """The corrected robot by way of its model file."""
    path = tmp_path_factory.mktemp("model") / "arm.elastocal.json"
    result.robot.save(path)
    return ec.read_model(path)


def test_a_model_file_predicts_corrects_and_certifies_alike(
    result, read_again, nominal, commands
):
    for first, second in zip(
        read_again.predict(commands), result.robot.predict(commands), strict=True
    ):
        np.testing.assert_allclose(first, second, atol=1e-12)
    table = wanted_poses(nominal, commands)
    corrected = read_again.correct(table).table
    expected = result.robot.correct(table).table
    pd.testing.assert_frame_equal(corrected, expected, rtol=1e-9)
    first = read_again.certify(2e-5)
    second = result.robot.certify(2e-5)
    assert first.decision == second.decision
    assert first.limit_m == pytest.approx(second.limit_m, rel=1e-9)


def test_a_model_file_keeps_the_verdict_and_the_robot(result, read_again, nominal):
    written = json.loads(json.dumps(to_document(result.verdict)))
    assert to_document(read_again.verdict) == written
    assert read_again.nominal.chain == nominal.chain


def test_another_file_is_no_model(tmp_path):
    path = tmp_path / "robot.json"
    path.write_text("[]", "utf-8")
    with pytest.raises(ec.InputError, match="no model file"):
        ec.read_model(path)


def test_a_new_urdf_needs_no_original(result, nominal, commands, tmp_path):
    path = tmp_path / "arm.urdf"
    assert result.robot.to_urdf(path) == 7
    robot = ec.read_robot(path, base="base_link", tip="tool")
    position, _ = compute_poses(robot.chain, commands, robot.chain.end_effector)
    np.testing.assert_allclose(position, result.robot.predict(commands)[0], atol=1e-9)


def test_a_model_of_mujoco_holds_the_wrong_zero(result, tmp_path):
    path = tmp_path / "arm.xml"
    assert result.robot.to_mjcf(path) == ()
    assert "<mujoco" in path.read_text("utf-8")


def test_a_kinematics_file_of_another_robot_is_refused(result, tmp_path):
    original = tmp_path / "kinematics.yaml"
    zero = dict.fromkeys(("x", "y", "z", "roll", "pitch", "yaw"), 0.0)
    document = {f"joint{number}": {"kinematic": zero} for number in range(1, 9)}
    original.write_text(yaml.safe_dump(document), "utf-8")
    with pytest.raises(ec.InputError, match="another robot"):
        result.robot.to_kinematics_file(tmp_path / "new.yaml", original)
    assert not (tmp_path / "new.yaml").exists()


@pytest.fixture(scope="module")
def measured_targets(result, nominal):
    """Corrected targets, and where the faulty robot stands at them."""
    bent = [0.3, -0.5, 1.0, 0.2, 0.8, 0.1]
    poses = bent + 0.3 * np.random.default_rng(4).uniform(-1.0, 1.0, (15, 6))
    path = result.robot.correct(wanted_poses(nominal, poses), allow_large_steps=True)
    true_angles = path.correction.joint_angles + np.eye(nominal.joints)[1] * 2e-3
    position, _ = compute_poses(nominal.chain, true_angles, nominal.chain.end_effector)
    noise = 2e-5 * np.random.default_rng(5).standard_normal(position.shape)
    return path, position + noise


def test_a_right_prediction_holds_and_a_wrong_one_does_not(result, measured_targets):
    path, position = measured_targets
    verified = result.robot.verify(path, position, tolerance_m=1e-3)
    assert verified.document["prediction"]["held"]
    assert verified.document["certificate"]["measured"]["decision"] == "pass"
    assert verified.document["before_rms_m"] > 1e-3
    wrong = position + np.array([0.0, 0.0, 1e-3])
    assert not ec.verify(result.robot, path, wrong).document["prediction"]["held"]


def test_files_and_arrays_are_verified_alike(result, measured_targets, tmp_path):
    path, position = measured_targets
    path.table.to_csv(tmp_path / "targets.csv", index=False)
    measured = pd.DataFrame(position, columns=[*"xyz"])
    measured.to_csv(tmp_path / "measured.csv", index=False)
    by_file = result.robot.verify(tmp_path / "targets.csv", tmp_path / "measured.csv")
    by_array = result.robot.verify(path, position)
    pd.testing.assert_frame_equal(by_file.table, by_array.table)


def test_positions_in_millimetres_are_refused(result, measured_targets):
    path, position = measured_targets
    with pytest.raises(ec.InputError, match="in metres"):
        result.robot.verify(path, 1e3 * position)


def test_targets_that_were_not_measured_are_left_out(result, measured_targets):
    path, position = measured_targets
    partly = position.copy()
    partly[3] = np.nan
    verified = result.robot.verify(path, partly)
    assert verified.document["not_measured"] == 1
    assert 4 not in verified.table["target"].to_numpy()


def test_a_model_file_verifies_alike(result, read_again, measured_targets):
    first = read_again.verify(*measured_targets)
    second = result.robot.verify(*measured_targets)
    pd.testing.assert_frame_equal(first.table, second.table)


def test_wrong_arguments_are_refused_by_name(result, measured_targets):
    path, position = measured_targets
    with pytest.raises(ec.InputError, match="verify: measured"):
        result.robot.verify(path, position[:5])
    with pytest.raises(ec.InputError, match="no position"):
        result.robot.verify(path, np.full_like(position, np.nan))
    with pytest.raises(ec.InputError, match=r"certify: tolerance_m.*0\.2"):
        ec.certify(result.robot, 0.2)
    with pytest.raises(ec.InputError, match="accepted_risk"):
        result.robot.certify(1e-3, accepted_risk=5.0)
