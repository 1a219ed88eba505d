"""What a certificate states in words."""

import json

import pytest
from made_certificates import made_document

from elastocal.report.certificate_words import (
    certificate_facts,
    decision_sentences,
    iso_rows,
    iso_warning,
    share_name,
    what_to_do,
)


@pytest.mark.parametrize(
    ("decision", "risk", "words"),
    [
        ("pass", 0.01, ["larger than the tolerance is 1 %", "5 % are accepted"]),
        ("pass", 0.0001, ["below 0.1 %"]),
        ("fail", 0.98, ["larger than the tolerance is 98 %"]),
        ("undecided", 0.4, ["larger than the tolerance is 40 %", "About 40 measured poses would decide"]),
    ],
)
def test_decisions_come_with_their_criterion_and_risk(decision, risk, words):
    text = decision_sentences(made_document(decision, risk_above=risk))
    criterion = (
        "the predicted RMS position error of the corrected robot, 95 % sure to be below 0.160 mm, against the tolerance of"
    )
    for word in (*words, f"{criterion} 0.200 mm", "Nobody has measured the corrected robot", "0.120 mm"):
        assert word in text


def test_only_what_was_measured_is_called_so():
    predicted, measured = (decision_sentences(made_document(measured=each)) for each in (False, True))
    assert "Measured position error" in measured and "Nobody has measured" not in measured
    assert "In 8 of 9 poses" in measured and "Measured" not in predicted and "poses every measurement" not in predicted
    headlines = [certificate_facts(made_document(measured=each))["headline"] for each in (False, True)]
    assert [each["title"] for each in headlines] == ["Pass, as predicted", "Pass, as measured"]
    assert "is predicted to keep" in what_to_do(made_document()) and "it keeps" in what_to_do(made_document(measured=True))


def test_errors_on_validation_poses_are_told_from_the_predicted_one():
    found = certificate_facts(made_document(measured=True))["whose"]
    assert "0.120 mm at validation poses is the tracker against the model" in found and "0.120 mm is the robot alone" in found


def test_the_tracker_is_named_where_it_hides_the_repeatability():
    document = made_document(measured=True)
    rows = iso_rows(document["iso_9283"], document["measured"])
    assert rows[-1][-1] == "so large that it hides the robot's own" and rows[2][1].startswith("100\u00a0µm (80.0")
    assert iso_rows(made_document(repeats=False)["iso_9283"], None) == [
        ["pose repeatability RP", "unknown", "no pose was approached again"]
    ]


@pytest.mark.parametrize(("approaches", "poses", "enough"), [(150, 5, True), (149, 5, False), (120, 4, False), (40, 10, False)])
def test_fewer_approaches_than_the_standard_asks_for_are_no_test_after_it(approaches, poses, enough):
    warning = iso_warning({"approaches": approaches, "poses": poses})
    assert (warning == "") is enough
    assert enough or f"{approaches} approaches to {poses} poses are fewer" in warning


def test_facts_are_json_and_every_line_of_the_budget_has_a_name():
    json.dumps(certificate_facts(made_document(measured=True)), allow_nan=False)
    assert share_name("link_weight") == "gravity sag" and share_name("repeatability") == "repeatability"
    assert certificate_facts(made_document())["budget"][-1][1] == "hidden by the tracker's noise"


def test_poses_that_say_too_little_of_the_use_are_the_reason_for_no_pass():
    text = decision_sentences(made_document("undecided", risk_above=0.01, shortfalls=["too few: 1 configurations judge"]))
    assert "the poses say too little of the robot's use to pass: too few: 1 configurations judge" in text
    assert "too much to pass" not in text
