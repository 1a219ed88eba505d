"""What a certificate states in words."""

import json

import pytest
from made_certificates import made_comparison, made_document

from elastocal.report.certificate_words import (
    accuracy_sentence,
    certificate_facts,
    comparison_facts,
    decision_sentences,
    iso_rows,
    share_name,
    what_to_do,
)


@pytest.mark.parametrize(
    ("decision", "risk", "words"),
    [
        ("pass", 0.01, ["is larger is 1 %", "5 % are accepted"]),
        ("pass", 0.0001, ["below 0.1 %"]),
        ("fail", 0.98, ["is smaller after all is 2 %"]),
        ("undecided", 0.4, ["is larger is 40 %", "About 40 validation poses would decide"]),
    ],
)
def test_decisions_come_with_their_risk(decision, risk, words):
    text = decision_sentences(made_document(decision, risk_above=risk))
    assert "120\u00a0µm RMS; the tolerance is 200\u00a0µm" in text
    for word in (*words, "In 8 of 9 poses", "57\u00a0%"):
        assert word in text


def test_errors_before_and_after_have_their_intervals():
    text = accuracy_sentence(made_document())
    assert (
        "1.50\u00a0mm (1.20\u00a0mm to 1.95\u00a0mm) uncorrected, 120\u00a0µm (96.0\u00a0µm to 156\u00a0µm) corrected" in text
    )
    rows = certificate_facts(made_document())["steps"]
    assert rows[-1][0] == "with lost motion (backlash)"
    assert rows[-1][3].endswith("(from 154\u00a0µm)") and "(" not in rows[-1][4]


@pytest.mark.parametrize(
    ("decision", "words"),
    [("pass", "keeps the tolerance"), ("fail", "not good enough"), ("undecided", "more validation poses")],
)
def test_each_decision_has_its_advice(decision, words):
    assert words in what_to_do(made_document(decision))


def test_advice_follows_a_change_and_a_correction_that_does_not_help():
    assert "moves differently than in cell_6" in what_to_do(made_document(comparison=made_comparison()))
    assert "No change since cell_6" in what_to_do(made_document(comparison=made_comparison(0.4)))
    document = made_document()
    document["held_out"][-1]["rms_m"] = 2e-3
    assert "Do not correct" in what_to_do(document)


def test_the_tracker_is_named_where_it_hides_the_repeatability():
    rows = iso_rows(made_document()["iso_9283"])
    assert rows[-1][-1] == "hides the robot's own" and rows[2][1].startswith("100\u00a0µm (80.0")
    assert iso_rows(made_document(repeats=False)["iso_9283"])[-1][1] == "unknown"


def test_changes_are_named_by_their_joint_and_counted():
    found = comparison_facts(made_comparison())
    assert "p = 0.0010" in found["sentence"] and found["sentence"].count("The robot has changed.") == 1
    assert found["rows"][0][0] == "Joint compliance under loads and weights: offset" and "joint 2" in found["rows"][2][0]
    assert found["rows"][0][3] == "200 ± 50 µrad"
    assert (len(found["rows"]), found["more"]) == (12, 2)
    assert "not compared one by one" in comparison_facts(made_comparison(0.5, 0))["sentence"]


def test_facts_are_json_and_every_line_of_the_budget_has_a_name():
    json.dumps(certificate_facts(made_document(comparison=made_comparison())), allow_nan=False)
    assert share_name("link_weight") == "gravity sag" and share_name("repeatability") == "repeatability"
    assert certificate_facts(made_document())["budget"][-1][1] == "hidden by the tracker's noise"
