"""The first page says the verdict in plain words, with probabilities and advice that follow from it."""

import pytest
from made_loop_facts import CAMPAIGNS, plainly
from made_loop_tables import effect_entry, experiment_rows, verdict_document

from elastocal.application.accuracy import BASE, PREDICTED, Accuracy
from elastocal.diagnosis.verdict import NAMED
from elastocal.report.first_page import (
    cause_rows,
    cost_words,
    headline,
    headline_sentence,
    sentences,
    what_to_do,
    whose_errors,
)

WORDS = {
    "adequate": "none of 30 candidate causes is needed",
    "named": "lacks one mechanism: lost motion (backlash) of joint 3.",
    "named, location uncertain": "Its location is less certain: joint 3 (80 %) and joint 5 (20 %).",
    "class": "most probably lost motion (backlash) of joint 3. Instead of lost motion (backlash) it may be bearing tilt or "
    "elastic bending and torsion: these measurements do not distinguish them.",
    "class with a related mechanism": "Instead of lost motion (backlash) it may be a related mechanism",
    "several": "lacks 2 mechanisms: lost motion (backlash) of joint 3 (94 %; 0.085 mm) and weight of an undeclared payload "
    "(94 %; 0.085 mm)",
    "unexplained": "a smooth error of unknown cause explains it better than any of 30 candidate causes",
    "not_testable": "show neither that something is missing nor that nothing is",
    "fault of the data": "The loads fit as if they were written in kilonewtons.",
}


@pytest.mark.parametrize("campaign", WORDS)
def test_the_verdict_is_said_in_plain_words(campaign):
    assert WORDS[campaign] in plainly(" ".join(sentences(CAMPAIGNS[campaign])))


def test_what_to_do_follows_from_the_verdict_and_from_the_gain():
    gained, lost, unsure = (
        what_to_do(verdict_document(NAMED, [effect_entry()], reduction=ends), [])[0]
        for ends in ((0.15, 0.32), (-0.3, -0.1), (-0.1, 0.3))
    )
    assert gained.startswith("Use the corrected model") and lost.startswith("Do not use") and "not certain" in unsure
    assert "the 10 poses of the next experiment, which the report lists" in what_to_do(CAMPAIGNS["class"], experiment_rows())[1]
    assert "trust the correction at poses and loads like these only" in what_to_do(CAMPAIGNS["class"], [])[1]
    assert any("extrapolated" in advice for advice in what_to_do(CAMPAIGNS["poses outside the range"], []))
    assert not any("extrapolated" in advice for advice in what_to_do(CAMPAIGNS["named"], []))
    assert "Use the declared model" in what_to_do(CAMPAIGNS["adequate"], [])[0]
    assert "loose target" in what_to_do(CAMPAIGNS["unexplained"], [])[0]


def test_the_headline_is_the_robot_as_it_was_and_as_it_is_in_mm_beside_the_noise():
    verdict = CAMPAIGNS["named"]
    stated = headline(verdict)
    assert plainly(headline_sentence(stated)) == ("0.171 → 0.084 mm (noise 0.050), RMS position error on 10 validation poses")
    assert headline(CAMPAIGNS["noise not known"])["noise"] == "" and headline(CAMPAIGNS["fault of the data"]) is None
    large = verdict["heldout"] | {"uncalibrated": {"rms_m": 1.184e-3}}
    assert headline(verdict | {"heldout": large})["before"] == "1.18"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"cost_m": 8.5e-5}, "0.085 mm"),
        # A third of 84 µm are 28: the error would be 88 µm without.
        ({"cost_m": 2.9e-5}, "0.029 mm"),
        ({"cost_m": 1.5e-5, "probability": 0.996}, "0.015 mm: real, negligible"),
        ({"cost_m": 1.5e-5, "probability": 0.7}, "0.015 mm: negligible"),
        ({"cost_m": 4.4e-10, "probability": 0.996}, "below 0.001 mm: real, negligible"),
        ({"cost_m": None}, "not in the final model"),
        ({"cost_m": None, "name": "setup_step"}, "an error of the measurement, not of the robot"),
    ],
)
def test_each_cause_states_its_cost_and_small_ones_are_negligible(changed, words):
    assert cost_words(effect_entry() | changed, CAMPAIGNS["named"]["heldout"]) == words


def test_causes_are_those_found_and_what_else_is_probable_with_the_probabilities_of_the_verdict():
    sets = [({"lost_motion": ["joint 3"]}, 0.6), ({"joint_tilt": ["joint 2"], "other": [""]}, 0.36), ({}, 0.04)]
    rows = cause_rows(verdict_document(NAMED, [effect_entry() | {"probability": 0.6}], sets=sets))
    assert [(row["name"], plainly(row["words"]), row["cost"]) for row in rows] == [
        ("Lost motion (backlash) of joint 3", "60 %", "0.085 mm"),
        ("Bearing tilt", "36 %", ""),
        ("A related mechanism", "36 %", ""),
        ("Nothing is missing", "4 %", ""),
    ]
    assert cause_rows(CAMPAIGNS["unexplained"])[0]["name"] == "Something that the catalogue does not have"


def test_a_robot_whose_calibration_predicts_worse_is_left_as_it_is():
    (advice,) = what_to_do(CAMPAIGNS["adequate"] | {"kept": "frames"}, [])
    assert advice.startswith("Leave the robot as its file has it")


MOSTLY = {
    "left_out_m": "effects that no command contains",
    "form_m": "the form of the model",
    "repeated_m": "each pose's own error and the repeatability of the joints",
}


@pytest.mark.parametrize("part", [*MOSTLY, None])
def test_measured_and_predicted_error_have_their_frame_and_the_predicted_one_its_largest_part(part):
    stated = Accuracy(BASE, PREDICTED, 1.74e-4, 4e-4, None, None, "", 9, "some poses", **{part: 1.57e-4} if part else {})
    mostly = MOSTLY.get(part, "the uncertainty of the parameters")
    assert whose_errors(5.8e-5, stated) == (
        "0.058 mm at validation poses is the tracker against the model, its noise included, in the declared base's frame; "
        f"0.174 mm is the robot alone, in the same frame, mostly from {mostly}."
    )
