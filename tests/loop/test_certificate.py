"""Contents of a certificate: those of the report where both state them, and what is wanted of it."""

from dataclasses import replace

import numpy as np
import pytest
from analysed_robots import ROBOTS
from made_calibrated import USUAL, made_calibrated
from planted import planted

from elastocal.application.accuracy import accuracy_from, accuracy_sentence
from elastocal.application.calibrated import nominal_forward
from elastocal.exchange.target_path import TargetPath
from elastocal.loop.calibrated_files import load_diagnosed
from elastocal.loop.certificate import Wanted, certificate, use_at

WANTED = Wanted(2e-4, 0.05, "SN 7", "2026-11-23", 1)


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
    assert [row["model"] for row in document["held_out"]] == ["uncorrected", "declared", "corrected"]
    assert document["held_out"][-1]["rms_m"] == pytest.approx(verdict["heldout"]["after"]["rms_m"], rel=1e-6)
    assert document["held_out"][-1]["max_m_low"] is None


def test_a_certificate_passes_below_and_fails_above_what_is_predicted(found, checkout, diagnosed):
    for share, decision in ((0.2, "fail"), (2.0, "pass")):
        wanted = replace(WANTED, tolerance_m=share * found["accuracy"]["rms_m"])
        assert certificate(checkout / "made", ROBOTS, diagnosed, wanted)["conformity"]["decision"] == decision


def test_the_worst_pose_is_the_one_of_the_largest_predicted_error(found):
    document = found
    # The largest of many random errors is larger than what any one pose is expected to have.
    assert 0.0 < document["worst_pose"]["error_m"] <= document["accuracy"]["worst_m"]
    assert {joint["unit"] for joint in document["worst_pose"]["joints"]} == {"rad"}


@pytest.fixture(scope="module")
def made(kuka):
    return made_calibrated(kuka, *USUAL)


def path_at(calibrated, angles, wrench):
    position, rotation = nominal_forward(calibrated.robot, calibrated.robot.reported_angles(angles))
    count = len(angles)
    start = calibrated.robot.reported_angles(angles)
    lines = tuple(range(2, count + 2))
    return TargetPath(position, rotation, start, np.tile(wrench, (count, 1)), None, None, None, lines)


def test_poses_within_what_was_fitted_are_corrected_and_not_beyond(kuka, made):
    states = planted(kuka, {}, seed=1, poses=20).observations.states
    angles = np.array([0.0, -0.6, 0.5, 0.3, 0.6, 0.1]) + 0.1 * np.eye(6)[:3]
    used = use_at(replace(made, fitted=states), path_at(made, angles, np.zeros(6)))
    assert not used.outside.any()
    assert np.abs(kuka.model_angles(used.reported_angles) - angles).max() < 0.02
