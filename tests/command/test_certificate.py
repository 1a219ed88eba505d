"""Certificates, as they are typed."""

import contextlib
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS, analysed
from certified import record_jobs
from scipy.spatial.transform import Rotation

from elastocal.application.accuracy import accuracy_from, accuracy_sentence, error_rows
from elastocal.application.calibrated import nominal_forward
from elastocal.campaigns.reading import campaign_files


@pytest.fixture
def run(in_checkout, elastocal):
    return lambda *words: elastocal("certificate", *words)


@pytest.fixture(scope="module")
def issued(checkout, elastocal):
    """A certificate's command and the folder that it wrote into."""
    with contextlib.chdir(checkout):
        result = elastocal("certificate", "made", "--tolerance", "0.5mm", "--serial", "7", "--date", "2026-11-20")
    return result, checkout / "reports" / "loop" / "made"


def test_pages_and_document_are_written_beside_the_report(issued):
    result, reports = issued
    assert result.exit_code == 0, result.output
    assert (reports / "certificate.pdf").read_bytes().startswith(b"%PDF")
    document = json.loads((reports / "certificate.json").read_text())
    assert (document["serial"], document["date"]) == ("7", "2026-11-20")
    assert document["conformity"]["tolerance_m"] == 5e-4
    # The answer in three lines: the decision, over which poses and of which point, what is missing.
    lines = result.output.splitlines()
    assert document["conformity"]["decision"] in lines[0] and "0.500 mm" in lines[0]
    assert document["point"] in lines[1] and "Nobody has measured" in lines[2] and lines[3].endswith(".pdf")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--tolerance", "0.5"], "0.2mm"),
        (["--tolerance", "0.5mm", "--date", "20 November"], "--date: found '20 November'; allowed: a date"),
        (["--tolerance", "0.5mm", "--serial", ""], "--serial: found ''; allowed: 1 to 60 characters"),
    ],
)
def test_bad_options_end_in_one_line_and_write_nothing(in_checkout, refusal, tmp_path, words, message):
    assert message in refusal("certificate", "made", *words, "--output", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_robot_is_judged_as_it_is_corrected(elastocal, regressed_checkout, monkeypatch, tmp_path):
    """What physics leaves fails where the regression on it passes."""
    monkeypatch.chdir(regressed_checkout)
    verdict = json.loads(Path("reports/loop/smooth/verdict.json").read_text())
    ends = verdict["accuracy"]["rms_bound_m"], verdict["physics"]["accuracy"]["rms_m"]
    assert ends[0] < ends[1]
    documents = {}
    for flags in ((), ("--physics-only",)):
        output = tmp_path / f"out{len(flags)}"
        elastocal("certificate", "smooth", "--tolerance", f"{1e3 * sum(ends) / 2:.4f}mm", "--output", output, *flags)
        documents[flags] = json.loads((output / "certificate.json").read_text())
    delivered, physics = documents.values()
    assert (delivered["conformity"]["decision"], physics["conformity"]["decision"]) == ("pass", "undecided")
    assert delivered["validation_rms_m"]["corrected"] == verdict["heldout"]["delivered"]["rms_m"]
    assert physics["validation_rms_m"]["corrected"] == verdict["heldout"]["after"]["rms_m"]
    left = ("uncertainty of the parameters", "repeatability", "form of the model", "not commanded", "left by the regression")
    squares = sum(line["rms_m"] ** 2 for line in delivered["budget"] if line["name"] in left)
    assert squares == pytest.approx(delivered["accuracy"]["rms_m"] ** 2, rel=1e-9)
    assert any(line["name"] == "regression" and line["rms_m"] > 1e-4 for line in delivered["budget"])


def test_data_at_fault_get_no_certificate(refusal, checkout, tmp_path, monkeypatch):
    shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    path = Path("reports/loop/made/verdict.json")
    verdict = json.loads(path.read_text()) | {"effects": [{"family": "data", "name": "wrong_sign"}], "accuracy": None}
    path.write_text(json.dumps(verdict))
    record_jobs("made", campaign_files("made", ROBOTS))
    assert "data at fault" in refusal("certificate", "made", "--tolerance", "0.5mm", "--output", "out")


def test_what_is_misplaced_is_said_where_the_robot_is_used(elastocal, checkout, tmp_path, monkeypatch):
    shutil.copytree(checkout, tmp_path / "top", symlinks=True)
    monkeypatch.chdir(tmp_path / "top")
    path, sentence = Path("reports/loop/made/verdict.json"), "reflector or tool sits 5.0 mm from where it is declared"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"misplaced": [{"sentence": sentence}]}))
    record_jobs("made", campaign_files("made", ROBOTS))
    robot = analysed("kuka")
    bent = robot.joint_limits.mean(axis=1) + np.array([[0.0, 0.2, 0.1, 0.3, 0.7, 0.0]])
    position, rotation = nominal_forward(robot, robot.reported_angles(bent))
    pose = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec()])
    pd.DataFrame(pose, columns=["x", "y", "z", "rx", "ry", "rz"]).to_csv("path.csv", index=False)
    for words in (("certificate", "made", "--tolerance", "0.5mm"), ("correct", "made", "path.csv", "--output", "targets.csv")):
        assert f"! {sentence}" in elastocal(*words).stderr, words
    assert json.loads(Path("reports/loop/made/certificate.json").read_text())["misplaced"] == [{"sentence": sentence}]


@pytest.fixture(scope="module")
def corrected(checkout, elastocal, tmp_path_factory):
    """Targets that `correct` wrote, their folder, and what it said."""
    folder, robot = tmp_path_factory.mktemp("corrected"), analysed("kuka")
    bent = (
        np.random.default_rng(1).uniform(-0.3, 0.3, (20, 6)) + robot.joint_limits.mean(axis=1) + [0.0, 0.2, 0.1, 0.3, 0.7, 0.0]
    )
    position, rotation = nominal_forward(robot, robot.reported_angles(bent))
    pose = np.column_stack([position, Rotation.from_matrix(rotation).as_rotvec()])
    pd.DataFrame(pose, columns=["x", "y", "z", "rx", "ry", "rz"]).to_csv(folder / "path.csv", index=False)
    with contextlib.chdir(checkout):
        found = elastocal("correct", "made", folder / "path.csv", "--output", folder / "targets.csv")
    assert found.exit_code == 0, found.output
    return folder, found.stderr


def test_one_campaign_has_one_accuracy_in_correct_and_certificate_to_the_digit(corrected, issued):
    words = accuracy_sentence(accuracy_from(json.loads((issued[1] / "certificate.json").read_text())["accuracy"]))
    assert words in corrected[1]


def test_what_the_robot_is_off_before_and_after_is_one_table_in_report_correct_and_certificate(corrected, issued, checkout):
    rows = error_rows(json.loads((checkout / "reports" / "loop" / "made" / "verdict.json").read_text()))
    document = json.loads((issued[1] / "certificate.json").read_text())
    assert document["errors"] == rows and len(rows) == 2
    assert document["budget"][0]["name"] == "uncorrected" and rows[1][1] == f"{1e3 * document['budget'][0]['rms_m']:.3f} mm"
    targets = pd.read_csv(corrected[0] / "targets.csv")
    before = 1e3 * np.sqrt((targets["predicted_error_before_m"] ** 2).mean())
    assert corrected[1].count(" uncorrected, ") == 3 and f"{before:.3f} mm uncorrected" in corrected[1]
    for where, uncorrected, after in rows:
        assert f"{where}: {uncorrected} uncorrected, {after} corrected" in corrected[1]


def test_a_prediction_that_fails_exits_with_1(run, checkout, tmp_path):
    result = run(checkout / "made", "--tolerance", "1um", "--output", tmp_path / "out")
    assert result.exit_code == 1 and result.output.startswith("! fail") and "Nobody has measured" in result.output
