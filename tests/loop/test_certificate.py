"""Contents of a certificate: those of the report where both state them, and what is wanted of it."""

from dataclasses import replace

import pytest
from analysed_robots import ROBOTS

from elastocal.application.accuracy import accuracy_from, accuracy_sentence
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.loop.certificate import Wanted, certificate

WANTED = Wanted(2e-4, 0.05, "SN 7", "2026-11-23")


@pytest.fixture(scope="module")
def diagnosed(checkout):
    return load_diagnosed(checkout / "made", ROBOTS, checkout)


@pytest.fixture(scope="module")
def found(checkout, diagnosed):
    return certificate(checkout / "made", ROBOTS, diagnosed, WANTED)


def test_one_accuracy_stands_in_headline_budget_and_report(found, diagnosed):
    document, verdict = found, diagnosed.verdict
    assert accuracy_sentence(accuracy_from(verdict["accuracy"])) == accuracy_sentence(accuracy_from(document["accuracy"]))
    assert document["accuracy"]["kind"] == "predicted"
    left = ("uncertainty of the parameters", "repeatability", "form of the model", "not commanded")
    squares = sum(line["rms_m"] ** 2 for line in document["budget"] if line["name"] in left)
    assert squares == pytest.approx(document["accuracy"]["rms_m"] ** 2, rel=1e-9)
    assert document["validation_rms_m"]["corrected"] == verdict["heldout"]["delivered"]["rms_m"]


def test_a_certificate_passes_below_and_fails_above_what_is_predicted(found, checkout, diagnosed):
    for share, decision in ((0.2, "fail"), (2.0, "pass")):
        wanted = replace(WANTED, tolerance_m=share * found["accuracy"]["rms_m"])
        assert certificate(checkout / "made", ROBOTS, diagnosed, wanted)["conformity"]["decision"] == decision


def test_the_worst_pose_is_the_one_of_the_largest_predicted_error(found):
    document = found
    # The largest of many random errors is larger than what any one pose is expected to have.
    assert 0.0 < document["worst_pose"]["error_m"] <= document["accuracy"]["worst_m"]
    assert {joint["unit"] for joint in document["worst_pose"]["joints"]} == {"rad"}
