"""`elastocal correct`: targets that reach the wanted poses, and programs with them.

Nothing is written if a pose cannot be reached.
"""

from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import compute_nominal_poses, predict_poses
from elastocal.campaigns import campaign_folder
from elastocal.loop.calibrated_files import load_diagnosed

JOINTS = [f"q{joint}" for joint in range(1, 7)]


def joint_columns(angles):
    return dict(zip(JOINTS, angles.T, strict=True))


def join_lines(text):
    return " ".join(text.split())


def test_correct_reads_the_documents_of_a_campaign_once(
    elastocal, correct_arguments, monkeypatch
):
    read_files = []
    read_document = campaign_folder.read_document

    def read_and_note(path):
        read_files.append(Path(path).name)
        return read_document(path)

    monkeypatch.setattr(campaign_folder, "read_document", read_and_note)
    assert elastocal(*correct_arguments).exit_code == 0
    assert read_files == ["campaign.yaml"]


def test_the_regression_corrects_residuals_of_the_physical_model(
    elastocal, regressed_checkout, monkeypatch, tmp_path, write_path
):
    """At poses between those of the campaign."""
    monkeypatch.chdir(regressed_checkout)
    campaign = load_diagnosed("smooth", ROBOTS, regressed_checkout)
    calibrated = campaign.calibrated
    angles = campaign.case.observations.states.joint_angles
    commands = calibrated.robot.reported_angles(0.5 * (angles[1:61] + angles[:60]))
    position, _ = compute_nominal_poses(calibrated.robot, commands)
    path = write_path(commands, **joint_columns(commands))
    output = tmp_path / "targets.csv"
    result = elastocal(
        "correct", "smooth", path, "--output", output, "--allow-large-steps"
    )
    assert result.exit_code == 0 and "Gaussian process" in result.stderr
    targets = pd.read_csv(output)[JOINTS].to_numpy()
    reached, _ = predict_poses(calibrated, targets)
    np.testing.assert_allclose(reached, position, atol=1e-8)
    by_physics, _ = predict_poses(campaign.without_regression().calibrated, targets)
    assert np.abs(by_physics - position).max() > 1e-5


def test_the_targets_bring_the_diagnosed_robot_to_the_wanted_poses(
    elastocal, correct_arguments, output, checkout, angles
):
    result = elastocal(*correct_arguments)
    assert result.exit_code == 0, result.stderr
    assert "8 targets corrected" in join_lines(result.stderr)
    targets = pd.read_csv(output)
    calibrated = load_diagnosed(checkout / "made", ROBOTS, checkout).calibrated
    wanted, _ = compute_nominal_poses(calibrated.robot, angles)
    reached, _ = predict_poses(calibrated, targets[JOINTS].to_numpy())
    np.testing.assert_allclose(reached, wanted, atol=1e-7)
    uncorrected = targets[[f"{joint}_uncorrected" for joint in JOINTS]].to_numpy()
    missed, _ = predict_poses(calibrated, uncorrected)
    distance = np.linalg.norm(wanted - missed, axis=1)
    np.testing.assert_allclose(targets["predicted_error_before_m"], distance, atol=1e-7)
    assert (targets["status"] == "ok").all() and (targets["predicted_std_m"] > 0).all()


def test_a_program_has_the_targets_and_says_where_they_are_from(
    elastocal, correct_arguments, output, checkout
):
    result = elastocal(*correct_arguments, "--format", "krl")
    assert result.exit_code == 0, result.stderr
    answer = join_lines(result.stderr)
    campaign = load_diagnosed(checkout / "made", ROBOTS, checkout).case.campaign
    is_said = "orientations were not measured" in answer
    assert is_said == (not campaign.measures_poses)
    assert "targets.src goes to all of them: KUKA KRL, q1 as A1" in answer
    program = output.with_suffix(".src").read_text()
    for remark in (
        "robot: KUKA KR 270 R2700 ultra",
        "campaign: made",
        f"date: {date.today()}",
        "tool: ",
    ):
        assert remark in program
    moves = [line[15:-1].split(", ") for line in program.splitlines() if "PTP" in line]
    degrees = [float(axis.split()[1]) for move in moves for axis in move]
    commands = pd.read_csv(output)[JOINTS].to_numpy()
    np.testing.assert_allclose(
        np.radians(degrees).reshape(len(moves), -1), commands, atol=1e-8
    )


def test_a_pose_out_of_reach_is_named_and_nothing_is_written(
    refusal, correct_arguments, path, output
):
    table = pd.read_csv(path)
    table.loc[2, "x"] += 6.0
    table.to_csv(path, index=False)
    assert "line 4 is unreachable" in refusal(*correct_arguments)
    assert not output.exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--format", "karel"), "krl | rapid | tp | urscript"),
        (("--axes", "A1,A2"), "with --format"),
        (("--output", "x.mod"), "ends in .csv"),
        (("--format", "krl", "--output", "my targets.csv"), "as the name of a program"),
    ],
)
def test_options_of_an_impossible_program_are_refused_before_any_work(
    refusal, correct_arguments, tmp_path, options, message
):
    assert message in refusal(*correct_arguments, *options)
    assert [file.name for file in tmp_path.iterdir()] == ["path.csv"]
    assert not Path("x.mod").exists()


def test_a_large_step_is_named_by_its_line_and_refused_unless_it_is_allowed(
    elastocal, refusal, correct_arguments, path, output, angles, write_path
):
    turned = angles.copy()
    turned[:4, 0] = np.radians(178.0)
    turned[4:, 0] = np.radians(-178.0)
    write_path(turned, **joint_columns(turned))
    message = refusal(*correct_arguments, "--format", "krl")
    assert "line 6: joint 1 turns by 356.0 degrees" in message
    assert "--allow-large-steps" in message
    assert not output.exists() and not output.with_suffix(".src").exists()
    result = elastocal(*correct_arguments, "--format", "krl", "--allow-large-steps")
    assert result.exit_code == 0 and output.with_suffix(".src").exists()
    assert "! line 6: joint 1 turns by 356.0 degrees" in join_lines(result.stderr)
    # Without stated angles there is a path without a large step.
    pd.read_csv(path).drop(columns=JOINTS).to_csv(path, index=False)
    assert elastocal(*correct_arguments).exit_code == 0
    assert np.abs(np.diff(pd.read_csv(output)["q1"])).max() < 0.1


def test_targets_keep_their_loads_and_have_no_bound_beyond_twice_the_measured_ones(
    elastocal, correct_arguments, checkout, output, angles, write_path
):
    campaign = load_diagnosed(checkout / "made", ROBOTS, checkout)
    measured = campaign.case.observations.states.wrench
    largest = np.linalg.norm(measured[:, :3], axis=1).max()
    loads = -largest * np.array([0.0, 1.0, 1.9, 1.99, 2.1, 3.0, 10.0, 100.0])
    write_path(angles, fx=0.0, fy=0.0, fz=loads)
    result = elastocal(*correct_arguments)
    assert result.exit_code == 0
    assert "no bound is stated for 4 of 8 targets" in join_lines(result.stderr)
    targets = pd.read_csv(output)
    assert targets["predicted_bound_m"].isna().tolist() == [False] * 4 + [True] * 4
    no_bound = "no bound: loads beyond 2 times the measured ones"
    assert targets["status"].tolist() == ["ok"] * 4 + [no_bound] * 4
    np.testing.assert_allclose(targets["fz"], loads)
    assert (targets[["fx", "mx", "my", "mz"]] == 0).all(axis=None)


@pytest.mark.parametrize("kept", ["path.csv", "top/made/measurements.csv"])
def test_targets_replace_neither_the_path_nor_the_measurements(
    copied_checkout, refusal, path, tmp_path, kept
):
    output = tmp_path / kept
    before = output.read_bytes()
    message = refusal("correct", "made", path, "--output", output)
    assert "a file that this command reads" in message
    assert output.read_bytes() == before


def test_targets_replace_a_file_of_the_user_with_force_alone(
    elastocal, refusal, correct_arguments, output
):
    output.write_text("mine\n")
    assert "no command of elastocal has written" in refusal(*correct_arguments)
    assert output.read_text() == "mine\n"
    assert elastocal(*correct_arguments, "--force").exit_code == 0
    assert elastocal(*correct_arguments).exit_code == 0


def test_a_path_of_the_controller_leads_to_the_same_targets(
    elastocal, correct_arguments, path, output, tmp_path
):
    """In mm, degrees and KUKA's angles A, B, C, with semicolons and decimal commas."""
    assert elastocal(*correct_arguments).exit_code == 0
    expected = pd.read_csv(output)
    poses = pd.read_csv(path)
    rotation = Rotation.from_rotvec(poses[["rx", "ry", "rz"]])
    euler = rotation.as_euler("ZYX", degrees=True)
    table = pd.DataFrame(
        np.hstack([1e3 * poses[["x", "y", "z"]], euler]),
        columns=["X [mm]", "Y [mm]", "Z [mm]", "A [deg]", "B [deg]", "C [deg]"],
    )
    other = tmp_path / "kuka.csv"
    table.to_csv(other, sep=";", decimal=",", index=False)
    arguments = ["correct", correct_arguments[1], other, "--output", output]
    result = elastocal(*arguments, "--rotation", "euler:ZYX")
    assert result.exit_code == 0, result.exception
    targets = pd.read_csv(output)
    np.testing.assert_allclose(targets[JOINTS], expected[JOINTS], atol=1e-9)


def test_poses_that_are_not_reached_are_left_out_with_partial_alone(
    elastocal, refusal, correct_arguments, path, output
):
    poses = pd.read_csv(path)
    poses.loc[3, "x"] += 6.0
    poses.to_csv(path, index=False)
    arguments = (*correct_arguments, "--format", "krl")
    message = refusal(*arguments)
    assert "line 5 is unreachable" in message and "--partial" in message
    assert not output.exists()
    result = elastocal(*arguments, "--partial")
    assert result.exit_code == 1
    answer = join_lines(result.stderr)
    assert "! 7 of 8 targets corrected" in answer
    assert "! not corrected: line 5 is unreachable" in answer
    assert "predicted orientation error there" in answer
    targets = pd.read_csv(output)
    assert targets["status"].tolist().count("unreachable") == 1
    assert targets[JOINTS].notna().all(axis=1).tolist() == [
        status != "unreachable" for status in targets["status"]
    ]
    program = output.with_suffix(".src").read_text()
    assert program.count("PTP {") == 7
    assert "left out of the path: line 5 is unreachable" in program
