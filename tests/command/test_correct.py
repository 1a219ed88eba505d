"""What a diagnosed campaign leads to, as it is typed: corrected targets, certificates,
and the calibrated robot as files.

Nothing is written where a pose cannot be reached.
"""

import json
import re
import shutil
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from certified import record_jobs
from made_urdf import joint, link
from made_urdf import robot as made
from scipy.spatial.transform import Rotation

from elastocal.application.calibrated import compute_nominal_poses, predict_poses
from elastocal.application.statements import tabulate_errors
from elastocal.campaigns import campaign_folder
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.campaigns.reading import read_robot
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.mechanics.kinematics import poses

BENT = np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])


def path_of(angles, folder, **more):
    """Wanted poses: where joint angles put the rigid robot."""
    position, rotation = compute_nominal_poses(analysed("kuka"), angles)
    pose = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec()])
    table = pd.DataFrame(pose, columns=["x", "y", "z", "rx", "ry", "rz"]).assign(**more)
    table.to_csv(folder / "path.csv", index=False)
    return folder / "path.csv"


def columns_of(angles):
    return {f"q{number}": column for number, column in enumerate(angles.T, 1)}


@pytest.fixture
def angles():
    return (
        analysed("kuka").joint_limits.mean(axis=1)
        + BENT
        + 0.2 * np.linspace(0, 1, 8)[:, None]
    )


@pytest.fixture
def path(tmp_path, angles):
    return path_of(angles, tmp_path)


@pytest.fixture
def output(tmp_path):
    return tmp_path / "targets.csv"


@pytest.fixture
def words(in_checkout, path, output):
    return "correct", in_checkout / "made", path, "--output", output


def test_correct_reads_the_documents_of_a_campaign_once(
    elastocal, words, checkout, monkeypatch
):
    read_files = []
    read_document = campaign_folder.read_document

    def read_and_note(path):
        read_files.append(Path(path).name)
        return read_document(path)

    monkeypatch.setattr(campaign_folder, "read_document", read_and_note)
    assert elastocal(*words).exit_code == 0
    assert read_files == ["campaign.yaml"]


def test_the_regression_corrects_what_physics_does_not_have(
    elastocal, regressed_checkout, monkeypatch, tmp_path
):
    """At poses between those of the campaign."""
    monkeypatch.chdir(regressed_checkout)
    found = load_diagnosed("smooth", ROBOTS, regressed_checkout)
    robot = found.calibrated.robot
    states = found.case.observations.states
    commands = robot.reported_angles(
        0.5 * (states.joint_angles[1:61] + states.joint_angles[:60])
    )
    position, _ = compute_nominal_poses(robot, commands)
    path = path_of(commands, tmp_path, **columns_of(commands))
    result = elastocal(
        "correct", "smooth", path, "--output", tmp_path / "t.csv", "--allow-large-steps"
    )
    assert result.exit_code == 0 and "Gaussian process" in result.stderr
    there = pd.read_csv(tmp_path / "t.csv")[[f"q{j}" for j in range(1, 7)]].to_numpy()
    np.testing.assert_allclose(
        predict_poses(found.calibrated, there)[0], position, atol=1e-8
    )
    assert (
        np.abs(predict_poses(found.by_physics().calibrated, there)[0] - position).max()
        > 1e-5
    )


def test_the_targets_bring_the_diagnosed_robot_to_the_wanted_poses_and_a_program_has_them(
    elastocal, words, output, checkout, angles
):
    result = elastocal(*words, "--format", "krl")
    assert result.exit_code == 0, result.stderr
    told = " ".join(result.stderr.split())
    assert (
        "8 targets corrected" in told
        and "targets.src goes to all of them: KUKA KRL, q1 as A1" in told
    )
    targets = pd.read_csv(output)
    commands = targets[[f"q{j}" for j in range(1, 7)]].to_numpy()
    robot = load_diagnosed(checkout / "made", ROBOTS, checkout).calibrated
    wanted, _ = compute_nominal_poses(robot.robot, angles)
    np.testing.assert_allclose(predict_poses(robot, commands)[0], wanted, atol=1e-7)
    missed = np.linalg.norm(
        wanted
        - predict_poses(
            robot, targets[[f"q{j}_uncorrected" for j in range(1, 7)]].to_numpy()
        )[0],
        axis=1,
    )
    np.testing.assert_allclose(targets["predicted_error_before_m"], missed, atol=1e-7)
    assert (targets["status"] == "ok").all() and (targets["predicted_std_m"] > 0).all()
    program = output.with_suffix(".src").read_text()
    for stated in (
        "robot: KUKA KR 270 R2700 ultra",
        "campaign: made",
        f"date: {date.today()}",
        "tool: ",
    ):
        assert stated in program
    moves = [line[15:-1].split(", ") for line in program.splitlines() if "PTP" in line]
    np.testing.assert_allclose(
        np.radians([[float(word.split()[1]) for word in move] for move in moves]),
        commands,
        atol=1e-8,
    )


def test_a_pose_out_of_reach_is_named_and_nothing_is_written(
    refusal, words, path, output
):
    beyond = [0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    pd.read_csv(path).assign(x=lambda wanted: wanted["x"] + beyond).to_csv(
        path, index=False
    )
    assert "line 4 is unreachable" in refusal(*words) and not output.exists()


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--format", "karel"), "krl | rapid | tp | urscript"),
        (("--axes", "A1,A2"), "with --format"),
        (("--output", "x.mod"), "ends in .csv"),
        (("--format", "krl", "--output", "my targets.csv"), "as the name of a program"),
    ],
)
def test_what_is_no_program_is_refused_before_any_work(
    refusal, words, tmp_path, more, message
):
    assert message in refusal(*words, *more)
    assert [file.name for file in tmp_path.iterdir()] == ["path.csv"] and not Path(
        "x.mod"
    ).exists()


def test_a_swing_is_named_by_its_line_and_no_program_is_written_unless_it_is_allowed(
    elastocal, refusal, words, path, output, angles
):
    turned = angles.copy()
    turned[:4, 0] = np.radians(178.0)
    turned[4:, 0] = np.radians(-178.0)
    path_of(turned, path.parent, **columns_of(turned))
    line = refusal(*words, "--format", "krl")
    assert (
        "line 6: joint 1 turns by 356.0 degrees" in line
        and "--allow-large-steps" in line
    )
    assert not output.exists() and not output.with_suffix(".src").exists()
    result = elastocal(*words, "--format", "krl", "--allow-large-steps")
    assert result.exit_code == 0 and output.with_suffix(".src").exists()
    assert "! line 6: joint 1 turns by 356.0 degrees" in " ".join(result.stderr.split())
    pd.read_csv(path).drop(columns=[f"q{joint}" for joint in range(1, 7)]).to_csv(
        path, index=False
    )
    assert elastocal(*words).exit_code == 0
    assert np.abs(np.diff(pd.read_csv(output)["q1"])).max() < 0.1


def test_targets_keep_their_loads_and_beyond_twice_the_measured_ones_have_no_bound(
    elastocal, words, checkout, path, output, angles
):
    measured = load_diagnosed(
        checkout / "made", ROBOTS, checkout
    ).case.observations.states.wrench
    largest = np.linalg.norm(measured[:, :3], axis=1).max()
    loads = -largest * np.array([0.0, 1.0, 1.9, 1.99, 2.1, 3.0, 10.0, 100.0])
    path_of(angles, path.parent, fx=0.0, fy=0.0, fz=loads)
    result = elastocal(*words)
    assert (
        result.exit_code == 0
        and "no bound is stated for 4 of 8 targets" in " ".join(result.stderr.split())
    )
    targets = pd.read_csv(output)
    assert targets["predicted_bound_m"].isna().tolist() == [False] * 4 + [True] * 4
    assert (targets["status"][:4] == "ok").all()
    assert (
        targets["status"][4:] == "no bound: loads beyond 2 times the measured ones"
    ).all()
    np.testing.assert_allclose(targets["fz"], loads)
    assert (targets[["fx", "mx", "my", "mz"]] == 0).all(axis=None)


CERTIFICATE = Path("reports/loop/made/certificate.json")
VERDICT = Path("reports/loop/made/verdict.json")


def issue(elastocal, *words):
    """A certificate's command, and its document."""
    result = elastocal("certificate", "made", "--tolerance", *words)
    return result, json.loads(CERTIFICATE.read_text())


def test_a_certificate_states_the_campaign_and_correct_its_targets(
    elastocal, refusal, words, output
):
    corrected = elastocal(*words).stderr
    assert "0.2mm" in refusal("certificate", "made", "--tolerance", "0.5")
    result, _ = issue(elastocal, "1um")
    assert result.exit_code == 1 and result.output.startswith("! fail")
    result, document = issue(elastocal, "0.5mm")
    assert result.exit_code == 0, result.output
    assert CERTIFICATE.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert document["conformity"]["tolerance_m"] == 5e-4
    # The answer in three lines: the decision, over which poses and of which point, what
    # is missing.
    lines = result.output.splitlines()
    assert document["conformity"]["decision"] in lines[0] and "0.500 mm" in lines[0]
    assert (
        "Nobody has measured" in lines[1]
        and document["point"] in lines[2]
        and lines[3].endswith(".pdf")
    )
    rows = tabulate_errors(json.loads(VERDICT.read_text()))
    assert document["errors"] == rows and len(rows) == 2
    assert (
        document["budget"][0]["name"] == "uncorrected"
        and rows[1][1] == f"{1e3 * document['budget'][0]['rms_m']:.3f} mm"
    )
    table = pd.read_csv(output)
    before, after = (
        1e3 * np.sqrt((table[f"predicted_error_{stage}_m"] ** 2).mean())
        for stage in ("before", "after")
    )
    assert (
        f"uncorrected they would be missed by {before:.3f} mm RMS" in corrected
        and f": {after:.3f} mm (" in corrected
    )


def test_the_robot_is_judged_as_it_is_corrected(
    elastocal, regressed_checkout, monkeypatch, tmp_path
):
    """What physics leaves fails where the regression on it passes; no file can hold
    it."""
    shutil.copytree(regressed_checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    reports = Path("reports/loop/smooth")
    verdict = json.loads((reports / "verdict.json").read_text())
    ends = verdict["accuracy"]["rms_bound_m"], verdict["physics"]["accuracy"]["rms_m"]
    assert ends[0] < ends[1]
    elastocal("certificate", "smooth", "--tolerance", f"{1e3 * sum(ends) / 2:.4f}mm")
    delivered = json.loads((reports / "certificate.json").read_text())
    assert delivered["conformity"]["decision"] == "pass"
    left = (
        "uncertainty of the parameters",
        "repeatability",
        "form of the model",
        "not commanded",
        "left by the regression",
    )
    squares = sum(
        line["rms_m"] ** 2 for line in delivered["budget"] if line["name"] in left
    )
    assert squares == pytest.approx(delivered["accuracy"]["rms_m"] ** 2, rel=1e-9)
    told = " ".join(
        elastocal("export", "smooth", "--output", tmp_path / "out").stderr.split()
    )
    lost = re.search(
        r"no file holds the Gaussian process .*?up to (\S+) mm at the measured poses \((\S+) mm RMS",
        told,
    )
    assert lost and 0.1 < float(lost[2]) < float(lost[1]) < 1.0
    assert f": {1e3 * verdict['physics']['accuracy']['rms_m']:.3f} mm (" in told


def test_what_is_misplaced_is_said_and_data_at_fault_get_no_certificate(
    elastocal, refusal, checkout, path, tmp_path, monkeypatch
):
    shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    verdict = json.loads(VERDICT.read_text())
    sentence = "reflector or tool sits 5.0 mm from where it is declared"
    VERDICT.write_text(json.dumps(verdict | {"misplaced": [{"sentence": sentence}]}))
    record_jobs("made", read_campaign_folder("made", ROBOTS).files())
    for words in (
        ("certificate", "made", "--tolerance", "0.5mm"),
        ("correct", "made", path, "--output", "t.csv"),
    ):
        assert f"! {sentence}" in elastocal(*words).stderr, words
    assert json.loads(CERTIFICATE.read_text())["misplaced"] == [{"sentence": sentence}]
    VERDICT.write_text(
        json.dumps(
            verdict
            | {"effects": [{"family": "data", "name": "wrong_sign"}], "accuracy": None}
        )
    )
    record_jobs("made", read_campaign_folder("made", ROBOTS).files())
    assert "data at fault" in refusal("certificate", "made", "--tolerance", "0.5mm")


ANGLES = 0.5 * np.linspace(-1, 1, 6)[None]


def test_the_robot_file_holds_what_was_found(in_checkout, elastocal, tmp_path):
    result = elastocal("export", "made", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    robot = read_robot(tmp_path / "out" / "robot.yaml")
    nominal = analysed("kuka")
    assert abs(robot.reported_offset[2] - nominal.reported_offset[2]) == pytest.approx(
        3e-4, rel=0.2
    )
    assert (robot.compliance != nominal.compliance).any()
    assert not (tmp_path / "out" / "robot.urdf").exists()
    assert "no file holds" not in result.stderr


def urdf_of(arm):
    """A robot as URDF, a joint for each of its transforms."""
    parts = [link("base")]
    above = "base"
    for number, each in enumerate(
        arm.chain.transforms[: arm.chain.end_effector.after], 1
    ):
        name = (
            arm.chain.end_effector.name
            if number == arm.chain.end_effector.after
            else f"l{number}"
        )
        axis = np.eye(3)[each.axis]
        place = (
            {"xyz" if each.kind == "T" else "rpy": each.constant * axis}
            if each.coordinate is None
            else {}
        )
        kind = "fixed" if place else "revolute"
        parts += [
            link(name),
            joint(
                f"j{number}", above, name, kind, axis=(each.sign or 1) * axis, **place
            ),
        ]
        above = name
    return made(*parts)


def test_the_users_urdf_comes_back_with_other_joint_origins_and_another_robots_is_refused(
    in_checkout, elastocal, refusal, tmp_path
):
    mine = tmp_path / "mine.urdf"
    output = tmp_path / "out"
    mine.write_text(
        urdf_of(analysed("kuka")).replace("<link ", "<!-- mine --><link ", 1)
    )
    result = elastocal("export", "made", "--urdf", mine, "--output", output)
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    assert (
        re.search(r"robot\.urdf: \d+ joint origins? changed, nothing else", told)
        and "cannot hold" not in told
    )
    text = (output / "robot.urdf").read_text()
    assert (
        text.count('effort="1"') == 6
        and "<!-- mine -->" in text
        and text != mine.read_text()
    )
    robot = read_robot(output / "robot.yaml")
    back = robot_from_urdf(
        output / "robot.urdf", "base", robot.chain.end_effector.name
    ).robot
    wanted = poses(robot.chain, robot.model_angles(ANGLES), robot.chain.end_effector)[0]
    np.testing.assert_allclose(
        poses(back.chain, ANGLES, back.chain.end_effector)[0], wanted, atol=1e-9
    )
    for wrong, where in (
        (urdf_of(analysed("gp180")), "imported"),
        ("<robot/>", "no <link>"),
    ):
        other = tmp_path / "other.urdf"
        other.write_text(wrong)
        assert where in refusal(
            "export", "made", "--urdf", other, "--output", tmp_path / "none"
        )
    assert "would be replaced" in refusal(
        "export", "made", "--urdf", output / "robot.urdf", "--output", output
    )
    assert (
        not (tmp_path / "none").exists() and (output / "robot.urdf").read_text() == text
    )
