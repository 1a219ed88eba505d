"""`elastocal certificate`: the decision, what it is based on, and when there is none."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from analysed_robots import ROBOTS
from certified import record_jobs
from made_loop_tables import CAMPAIGNS

from elastocal.application.statements import tabulate_errors
from elastocal.campaigns.campaign_folder import read_campaign_folder
from elastocal.io.typed_json import to_document
from elastocal.verdict import MisplacedFrame, read_verdict, write_verdict

REPORT = Path("reports/loop/made")
CERTIFICATE = REPORT / "certificate.json"
VERDICT = REPORT / "verdict.json"
# Contributions to the error of the corrected robot, whose squares add up.
CONTRIBUTIONS = (
    "uncertainty of the parameters",
    "repeatability",
    "form of the model",
    "not commanded",
    "left by the regression",
)


def certify(elastocal, tolerance):
    """Run the command; return its result and the document that it has written."""
    result = elastocal("certificate", "made", "--tolerance", tolerance)
    return result, json.loads(CERTIFICATE.read_text())


def change_verdict(**changes):
    """Change the verdict of a campaign as if its diagnosis had written it."""
    write_verdict(VERDICT, replace(read_verdict(VERDICT), **changes))
    record_jobs("made", read_campaign_folder("made", ROBOTS).files())


def test_a_tolerance_needs_its_unit_and_a_tight_one_fails(
    elastocal, refusal, in_checkout
):
    assert "0.2mm" in refusal("certificate", "made", "--tolerance", "0.5")
    result, _ = certify(elastocal, "1um")
    assert result.exit_code == 1 and result.output.startswith("! fail")


@pytest.mark.drawn
def test_a_certificate_states_the_errors_of_the_campaign(elastocal, in_checkout):
    result, document = certify(elastocal, "0.5mm")
    assert result.exit_code == 0, result.output
    assert CERTIFICATE.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert document["conformity"]["tolerance_m"] == 5e-4
    decision, sentences, _, point, pages, _, following = result.output.splitlines()
    assert document["conformity"]["decision"] in decision and "0.500 mm" in decision
    assert "has not been measured" in sentences
    assert document["point"] in point and pages.endswith(".pdf")
    assert following.startswith("next: elastocal verify ")
    measured_and_predicted = tabulate_errors(read_verdict(VERDICT))
    assert document["errors"] == measured_and_predicted
    measured, predicted = measured_and_predicted
    before = document["budget"][0]
    assert before["name"] == "before"
    assert measured[1] == f"{1e3 * before['rms_m']:.3f} mm" and not predicted[1]


def test_correct_states_the_errors_of_its_targets(elastocal, correct_arguments, output):
    answer = elastocal(*correct_arguments).stderr
    targets = pd.read_csv(output)
    before = 1e3 * np.sqrt((targets["predicted_error_before_m"] ** 2).mean())
    after = 1e3 * np.sqrt((targets["predicted_error_after_m"] ** 2).mean())
    assert f"uncorrected they would be missed by {before:.3f} mm RMS" in answer
    assert f": {after:.3f} mm (" in answer


def test_the_robot_is_judged_as_it_is_corrected(elastocal, copied_regressed_checkout):
    """A tolerance that the physical model alone would fail is passed with the
    regression on its residuals."""
    report = Path("reports/loop/smooth")
    verdict = json.loads((report / "verdict.json").read_text())
    with_regression_m = verdict["accuracy"]["rms_bound_m"]
    by_physics_m = verdict["physics"]["rms_m"]
    assert with_regression_m < by_physics_m
    tolerance_mm = 1e3 * (with_regression_m + by_physics_m) / 2
    elastocal("certificate", "smooth", "--tolerance", f"{tolerance_mm:.4f}mm")
    document = json.loads((report / "certificate.json").read_text())
    assert document["conformity"]["decision"] == "pass"
    sum_of_squares = sum(
        entry["rms_m"] ** 2
        for entry in document["budget"]
        if entry["name"] in CONTRIBUTIONS
    )
    rms_m = document["accuracy"]["rms_m"]
    assert sum_of_squares == pytest.approx(rms_m**2, rel=1e-9)


def test_certificate_and_correct_warn_of_a_misplaced_frame(
    elastocal, copied_checkout, path
):
    sentence = "reflector or tool sits 5.0 mm from where it is declared"
    frame = MisplacedFrame("reflector or tool", (), (0.0, 0.0, 5e-3), 10.0, sentence)
    change_verdict(misplaced=(frame,))
    result, document = certify(elastocal, "0.5mm")
    assert f"! {sentence}" in result.stderr
    assert document["misplaced"] == [to_document(frame)]
    result = elastocal("correct", "made", path, "--output", "targets.csv")
    assert f"! {sentence}" in result.stderr


def test_data_at_fault_get_no_certificate(refusal, copied_checkout):
    faults = CAMPAIGNS["fault of the data"].effects
    change_verdict(effects=faults, accuracy=None)
    assert "data at fault" in refusal("certificate", "made", "--tolerance", "0.5mm")
