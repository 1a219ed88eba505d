"""Certificates, as they are typed, and the calibrated robot as files that are read again."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from certified import record_jobs
from made_urdf import joint, link
from made_urdf import robot as made
from scipy.spatial.transform import Rotation

from elastocal.application.accuracy import Accuracy, accuracy_sentence, error_rows
from elastocal.application.calibrated import nominal_forward
from elastocal.campaigns.reading import campaign_files, read_robot
from elastocal.exchange.dh import robot_from_dh
from elastocal.exchange.urdf import robot_from_urdf
from elastocal.mechanics.kinematics import poses

CERTIFICATE, VERDICT = Path("reports/loop/made/certificate.json"), Path("reports/loop/made/verdict.json")


def issue(elastocal, *words):
    """A certificate's command, and its document."""
    result = elastocal("certificate", "made", "--tolerance", *words)
    return result, json.loads(CERTIFICATE.read_text())


def path_of(count, folder):
    robot = analysed("kuka")
    bent = np.random.default_rng(1).uniform(-0.3, 0.3, (count, 6)) + np.array([0.0, 0.2, 0.1, 0.3, 0.7, 0.0])
    position, rotation = nominal_forward(robot, robot.reported_angles(bent + robot.joint_limits.mean(axis=1)))
    pose = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec()])
    pd.DataFrame(pose, columns=["x", "y", "z", "rx", "ry", "rz"]).to_csv(folder / "path.csv", index=False)
    return folder / "path.csv"


@pytest.fixture(scope="module")
def corrected(checkout, elastocal, tmp_path_factory):
    """Targets that `correct` wrote, their folder, and what it said."""
    folder = tmp_path_factory.mktemp("corrected")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(checkout)
        found = elastocal("correct", "made", path_of(20, folder), "--output", folder / "targets.csv")
    assert found.exit_code == 0, found.output
    return folder, found.stderr


def test_a_certificate_has_the_accuracy_and_the_table_that_correct_states_to_the_digit(
    in_checkout, elastocal, refusal, corrected
):
    assert "0.2mm" in refusal("certificate", "made", "--tolerance", "0.5")
    result, _ = issue(elastocal, "1um")
    assert result.exit_code == 1 and result.output.startswith("! fail")
    result, document = issue(elastocal, "0.5mm")
    assert result.exit_code == 0, result.output
    assert CERTIFICATE.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert document["conformity"]["tolerance_m"] == 5e-4
    # The answer in three lines: the decision, over which poses and of which point, what is missing.
    lines = result.output.splitlines()
    assert document["conformity"]["decision"] in lines[0] and "0.500 mm" in lines[0]
    assert document["point"] in lines[1] and "Nobody has measured" in lines[2] and lines[3].endswith(".pdf")
    assert accuracy_sentence(Accuracy(**document["accuracy"])) in corrected[1]
    rows = error_rows(json.loads(VERDICT.read_text()))
    assert document["errors"] == rows and len(rows) == 2
    assert document["budget"][0]["name"] == "uncorrected" and rows[1][1] == f"{1e3 * document['budget'][0]['rms_m']:.3f} mm"
    targets = pd.read_csv(corrected[0] / "targets.csv")
    before = 1e3 * np.sqrt((targets["predicted_error_before_m"] ** 2).mean())
    assert corrected[1].count(" uncorrected, ") == 3 and f"{before:.3f} mm uncorrected" in corrected[1]
    for where, uncorrected, after in rows:
        assert f"{where}: {uncorrected} uncorrected, {after} corrected" in corrected[1]


def test_the_robot_is_judged_as_it_is_corrected(elastocal, regressed_checkout, monkeypatch, tmp_path):
    """What physics leaves fails where the regression on it passes; no file can hold it."""
    shutil.copytree(regressed_checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    reports = Path("reports/loop/smooth")
    verdict = json.loads((reports / "verdict.json").read_text())
    ends = verdict["accuracy"]["rms_bound_m"], verdict["physics"]["accuracy"]["rms_m"]
    assert ends[0] < ends[1]
    for flags, decision in ((("--physics-only",), "undecided"), ((), "pass")):
        elastocal("certificate", "smooth", "--tolerance", f"{1e3 * sum(ends) / 2:.4f}mm", *flags)
        delivered = json.loads((reports / "certificate.json").read_text())
        assert delivered["conformity"]["decision"] == decision
    left = ("uncertainty of the parameters", "repeatability", "form of the model", "not commanded", "left by the regression")
    squares = sum(line["rms_m"] ** 2 for line in delivered["budget"] if line["name"] in left)
    assert squares == pytest.approx(delivered["accuracy"]["rms_m"] ** 2, rel=1e-9)
    told = " ".join(elastocal("export", "smooth", "--output", tmp_path / "out").stderr.split())
    lost = re.search(r"no file holds the Gaussian process .*?up to (\S+) mm at the measured poses \((\S+) mm RMS", told)
    assert lost and 0.1 < float(lost[2]) < float(lost[1]) < 1.0
    stated = json.loads((tmp_path / "out" / "effects.json").read_text())["accuracy"]
    assert stated["rms_m"] == pytest.approx(verdict["physics"]["accuracy"]["rms_m"], rel=1e-3)


def test_what_is_misplaced_is_said_and_data_at_fault_get_no_certificate(elastocal, refusal, checkout, tmp_path, monkeypatch):
    shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    verdict, sentence = json.loads(VERDICT.read_text()), "reflector or tool sits 5.0 mm from where it is declared"
    VERDICT.write_text(json.dumps(verdict | {"misplaced": [{"sentence": sentence}]}))
    record_jobs("made", campaign_files("made", ROBOTS))
    for words in (
        ("certificate", "made", "--tolerance", "0.5mm"),
        ("correct", "made", path_of(1, tmp_path), "--output", "t.csv"),
    ):
        assert f"! {sentence}" in elastocal(*words).stderr, words
    assert json.loads(CERTIFICATE.read_text())["misplaced"] == [{"sentence": sentence}]
    VERDICT.write_text(json.dumps(verdict | {"effects": [{"family": "data", "name": "wrong_sign"}], "accuracy": None}))
    record_jobs("made", campaign_files("made", ROBOTS))
    assert "data at fault" in refusal("certificate", "made", "--tolerance", "0.5mm")


ANGLES = 0.5 * np.linspace(-1, 1, 6)[None]


def test_robot_file_urdf_dh_and_sidecar_hold_what_was_found(in_checkout, elastocal, tmp_path):
    result = elastocal("export", "made", "--output", tmp_path / "out")
    assert result.exit_code == 0, result.output
    robot, nominal = read_robot(tmp_path / "out" / "robot.yaml"), analysed("kuka")
    assert abs(robot.reported_offset[2] - nominal.reported_offset[2]) == pytest.approx(3e-4, rel=0.2)
    assert (robot.compliance != nominal.compliance).any()
    assert not (tmp_path / "out" / "robot.urdf").exists()
    by_table = robot_from_dh(tmp_path / "out" / "dh.csv").robot
    mine = poses(robot.chain, robot.model_angles(ANGLES), robot.chain.end_effector)
    theirs = poses(by_table.chain, by_table.model_angles(ANGLES), by_table.chain.end_effector)
    for one, other in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(other, one, atol=1e-9)
    deltas = pd.read_csv(tmp_path / "out" / "dh_deltas.csv").set_index("row")
    assert abs(deltas.loc["q3", "delta_theta_deg"]) == pytest.approx(np.degrees(3e-4), rel=0.2)
    document = json.loads((tmp_path / "out" / "effects.json").read_text())
    assert all(spring["std_error"] != 0 for spring in document["joint_compliance"])
    assert document["effects"] == [] and len(document["joint_compliance"]) == 6


def urdf_of(arm):
    """A robot as URDF, a joint for each of its transforms."""
    parts, above = [link("base")], "base"
    for number, each in enumerate(arm.chain.transforms[: arm.chain.end_effector.after], 1):
        name = arm.chain.end_effector.name if number == arm.chain.end_effector.after else f"l{number}"
        axis = np.eye(3)[each.axis]
        place = {"xyz" if each.kind == "T" else "rpy": each.constant * axis} if each.coordinate is None else {}
        kind = "fixed" if place else "revolute"
        parts += [link(name), joint(f"j{number}", above, name, kind, axis=(each.sign or 1) * axis, **place)]
        above = name
    return made(*parts)


def test_the_users_urdf_comes_back_with_other_joint_origins_and_another_robots_is_refused(
    in_checkout, elastocal, refusal, tmp_path
):
    mine, output = tmp_path / "mine.urdf", tmp_path / "out"
    mine.write_text(urdf_of(analysed("kuka")).replace("<link ", "<!-- mine --><link ", 1))
    result = elastocal("export", "made", "--urdf", mine, "--output", output)
    assert result.exit_code == 0, result.output
    told = " ".join(result.stderr.split())
    assert re.search(r"robot\.urdf: \d+ joint origins? changed, nothing else", told) and "cannot hold" not in told
    text = (output / "robot.urdf").read_text()
    assert text.count('effort="1"') == 6 and "<!-- mine -->" in text and text != mine.read_text()
    robot = read_robot(output / "robot.yaml")
    back = robot_from_urdf(output / "robot.urdf", "base", robot.chain.end_effector.name).robot
    wanted = poses(robot.chain, robot.model_angles(ANGLES), robot.chain.end_effector)[0]
    np.testing.assert_allclose(poses(back.chain, ANGLES, back.chain.end_effector)[0], wanted, atol=1e-9)
    for wrong, where in ((urdf_of(analysed("gp180")), "imported"), ("<robot/>", "no <link>")):
        other = tmp_path / "other.urdf"
        other.write_text(wrong)
        assert where in refusal("export", "made", "--urdf", other, "--output", tmp_path / "none")
    assert "would be replaced" in refusal("export", "made", "--urdf", output / "robot.urdf", "--output", output)
    assert not (tmp_path / "none").exists() and (output / "robot.urdf").read_text() == text
