"""Wanted poses in, joint targets out; nothing is written where a pose cannot be reached."""

from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from made_remainders import smooth
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import forward, nominal_forward
from elastocal.application.frames import root_mean_square, subtract_placement
from elastocal.loop.calibrated_files import load_diagnosed

BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


@pytest.fixture
def angles():
    return analysed("kuka").joint_limits.mean(axis=1) + BENT + 0.2 * np.linspace(0, 1, 8)[:, None]


@pytest.fixture
def path(tmp_path, angles):
    """Wanted poses."""
    position, rotation = nominal_forward(analysed("kuka"), angles)
    columns = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec()])
    pd.DataFrame(columns, columns=["x", "y", "z", "rx", "ry", "rz"]).to_csv(tmp_path / "path.csv", index=False)
    return tmp_path / "path.csv"


@pytest.fixture
def output(tmp_path):
    return tmp_path / "targets.csv"


@pytest.fixture
def words(in_checkout, path, output):
    return "correct", in_checkout / "made", path, "--output", output


def missed(robot, scope, wanted, commands):
    """RMS error in m of a robot that errs by `smooth`, after the best placement of its base."""
    position, rotation = nominal_forward(robot, commands)
    off = (wanted - position - smooth(robot.model_angles(commands)))[..., None]
    off = subtract_placement(scope, position, rotation, np.concatenate([off, 0 * off], axis=1))
    return root_mean_square(off[:, :3, 0])


def test_the_regression_corrects_what_physics_does_not_have(elastocal, regressed_checkout, monkeypatch, tmp_path):
    """At poses between those of the campaign: how close the robot then comes to them, by what it really errs by."""
    monkeypatch.chdir(regressed_checkout)
    found = load_diagnosed("smooth", ROBOTS, regressed_checkout)
    robot, states = found.calibrated.robot, found.case.observations.states
    commands = robot.reported_angles(0.5 * (states.joint_angles[1:] + states.joint_angles[:-1]))
    position, rotation = nominal_forward(robot, commands)
    names = ["x", "y", "z", "rx", "ry", "rz", *(f"q{joint}" for joint in range(1, 7))]
    wanted = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec(), commands])
    pd.DataFrame(wanted, columns=names).to_csv(tmp_path / "path.csv", index=False)
    words, errors = ("--partial", "--allow-large-steps"), {}
    for flags, corrected in (((), found), (("--physics-only",), found.by_physics())):
        result = elastocal("correct", "smooth", tmp_path / "path.csv", "--output", tmp_path / "t.csv", *words, *flags)
        assert ("Gaussian process" in result.stderr) == (not flags)
        targets = pd.read_csv(tmp_path / "t.csv")
        good = (targets["status"] == "ok").to_numpy()
        assert good.mean() > 0.9
        there = targets.loc[good, [f"q{j}" for j in range(1, 7)]].to_numpy()
        errors[flags] = missed(robot, found.calibrated.scope, position[good], there)
        np.testing.assert_allclose(forward(corrected.calibrated, there)[0], position[good], atol=1e-8)
        assert errors[flags] < targets["predicted_bound_m"].mean()
    assert errors[()] < 0.5 * errors["--physics-only",]


def moved_away(path, rows):
    """The path with some of its poses out of reach."""
    table = pd.read_csv(path)
    table.loc[rows, "x"] = 8.0
    table.to_csv(path, index=False)


def test_the_targets_bring_the_diagnosed_robot_to_the_wanted_poses_and_a_program_has_them(
    elastocal, words, output, checkout, angles
):
    result = elastocal(*words, "--format", "krl")
    assert result.exit_code == 0, result.stderr
    told = " ".join(result.stderr.split())
    assert "8 of 8 targets corrected" in told and "targets.src goes to 8 of 8 targets: KUKA KRL, q1 as A1" in told
    targets = pd.read_csv(output)
    commands = targets[[f"q{j}" for j in range(1, 7)]].to_numpy()
    robot = load_diagnosed(checkout / "made", ROBOTS, checkout).calibrated
    wanted, _ = nominal_forward(robot.robot, angles)
    np.testing.assert_allclose(forward(robot, commands)[0], wanted, atol=1e-7)
    missed = np.linalg.norm(wanted - forward(robot, targets[[f"q{j}_uncorrected" for j in range(1, 7)]].to_numpy())[0], axis=1)
    np.testing.assert_allclose(targets["predicted_error_before_m"], missed, atol=1e-7)
    assert (targets["status"] == "ok").all() and (targets["predicted_std_m"] > 0).all()
    program = output.with_suffix(".src").read_text()
    for stated in ("robot: KUKA KR 270 R2700 ultra", "campaign: made", f"date: {date.today()}", "tool: "):
        assert stated in program
    moves = [line[15:-1].split(", ") for line in program.splitlines() if "PTP" in line]
    np.testing.assert_allclose(np.radians([[float(word.split()[1]) for word in move] for move in moves]), commands, atol=1e-8)


def test_a_pose_out_of_reach_is_named_and_nothing_is_written_and_in_no_program(elastocal, refusal, words, path, output):
    moved_away(path, [2])
    assert "line 4 is unreachable" in refusal(*words) and not output.exists()
    result = elastocal(*words, "--partial", "--format", "tp")
    assert result.exit_code == 0
    assert pd.read_csv(output)["status"].tolist().count("ok") == 7
    assert "7 of 8 targets corrected" in result.stderr and "targets.ls goes to 7 of 8" in " ".join(result.stderr.split())
    assert output.with_suffix(".ls").read_text().count("GP1:") == 7
    moved_away(path, slice(None))
    assert "no pose" in refusal(*words, "--partial", "--format", "urscript")
    assert not output.with_suffix(".script").exists()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--format", "karel"), "krl | rapid | tp | urscript"),
        (("--axes", "A1,A2"), "with --format"),
        (("--output", "x.mod"), "ends in .csv"),
        (("--format", "krl", "--output", "my targets.csv"), "as the name of a program"),
    ],
)
def test_what_is_no_program_is_refused_before_any_work(refusal, words, tmp_path, more, message):
    assert message in refusal(*words, *more)
    assert [file.name for file in tmp_path.iterdir()] == ["path.csv"] and not Path("x.mod").exists()


def stating(path, **columns):
    """The path with more columns."""
    pd.read_csv(path).assign(**columns).to_csv(path, index=False)


def test_a_swing_is_named_by_its_line_and_no_program_is_written_unless_it_is_allowed(
    elastocal, refusal, words, path, output, angles
):
    turned = angles.copy()
    turned[:4, 0], turned[4:, 0] = np.radians(178.0), np.radians(-178.0)
    position, rotation = nominal_forward(analysed("kuka"), analysed("kuka").reported_angles(turned))
    pose = dict(zip(["x", "y", "z"], position.T, strict=True))
    turn = dict(zip(["rx", "ry", "rz"], Rotation.from_matrix(rotation).as_rotvec().T, strict=True))
    stating(path, **pose, **turn, **{f"q{j}": q for j, q in enumerate(analysed("kuka").reported_angles(turned).T, 1)})
    line = refusal(*words, "--format", "krl")
    assert "line 6: joint 1 turns by 356.0 degrees" in line and "--allow-large-steps" in line
    assert not output.exists() and not output.with_suffix(".src").exists()
    result = elastocal(*words, "--format", "krl", "--allow-large-steps")
    assert result.exit_code == 0 and output.with_suffix(".src").exists()
    assert "! line 6: joint 1 turns by 356.0 degrees" in " ".join(result.stderr.split())
    pd.read_csv(path).drop(columns=[f"q{joint}" for joint in range(1, 7)]).to_csv(path, index=False)
    assert elastocal(*words).exit_code == 0
    assert np.abs(np.diff(pd.read_csv(output)["q1"])).max() < 0.1


def test_targets_keep_their_loads_and_beyond_twice_the_measured_ones_have_no_bound(elastocal, words, checkout, path, output):
    measured = load_diagnosed(checkout / "made", ROBOTS, checkout).case.observations.states.wrench
    largest = np.linalg.norm(measured[:, :3], axis=1).max()
    stating(path, fx=0.0, fy=0.0, fz=-largest * np.array([0.0, 1.0, 1.9, 1.99, 2.1, 3.0, 10.0, 100.0]))
    result = elastocal(*words)
    assert result.exit_code == 0 and "no bound is stated for 4 of 8 targets" in " ".join(result.stderr.split())
    targets = pd.read_csv(output)
    assert targets["predicted_bound_m"].isna().tolist() == [False] * 4 + [True] * 4
    assert (targets["status"][:4] == "ok").all()
    assert (targets["status"][4:] == "no bound: loads beyond 2 times the measured ones").all()
    np.testing.assert_allclose(targets["fz"], pd.read_csv(path)["fz"])
    assert (targets[["fx", "mx", "my", "mz"]] == 0).all(axis=None)
