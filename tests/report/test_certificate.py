"""A certificate states its decision with criterion and risk, and is typeset."""

import json

import pytest
from drawn_figures import empty_pictures
from made_certificates import make_document

from elastocal.report.certificate import collect_certificate_facts, name_budget_entry
from elastocal.report.typesetting import compile_document


@pytest.mark.parametrize(
    ("decision", "changed", "phrases"),
    [
        (
            "pass",
            {"risk_above": 0.01},
            ["larger than the tolerance is 1 %; the accepted risk is 5 %"],
        ),
        ("pass", {"risk_above": 0.0001}, ["is below 0.1 %;"]),
        (
            "fail",
            {"risk_above": 0.98},
            ["larger than the tolerance is 98 %; the accepted risk of a wrong fail"],
        ),
        ("undecided", {"risk_above": 0.4}, ["is 40 %: too high to pass"]),
        (
            "undecided",
            {"risk_above": 0.01, "shortfalls": ["too few"]},
            ["too little of the robot's use to pass: too few."],
        ),
    ],
)
def test_decisions_come_with_their_criterion_and_risk(decision, changed, phrases):
    text = collect_certificate_facts(make_document(decision, **changed))[
        "decision_sentences"
    ]
    criterion = (
        "the predicted RMS position error of the corrected robot, 95 % sure to be "
        "below 0.160 mm, against the tolerance of 0.200 mm"
    )
    for phrase in (
        *phrases,
        criterion,
        "The corrected robot has not been measured",
        "0.120 mm",
    ):
        assert phrase in text
    assert ("too high to pass" in text) == (changed["risk_above"] == 0.4)


def test_a_correction_that_makes_validation_poses_worse_is_advised_against():
    document = make_document()
    document["validation_rms_m"]["corrected"] = 2e-3
    assert collect_certificate_facts(document)["now"].startswith(
        "Do not correct the robot with this campaign"
    )


@pytest.mark.parametrize("decision", ["pass", "fail", "undecided"])
def test_every_kind_of_certificate_is_typeset(tmp_path, decision):
    facts = collect_certificate_facts(
        make_document(decision, misplaced=decision == "fail")
    )
    json.dumps(facts, allow_nan=False)
    small = collect_certificate_facts(
        make_document() | {"budget": [{"name": "payload", "rms_m": 5e-8}]}
    )
    assert small["budget"] == [["weight of an undeclared payload", "below 0.1\u00a0µm"]]
    assert (
        facts["budget"][-1][1] == "hidden by the tracker's noise"
        and name_budget_entry("link_weight") == "gravity sag"
    )
    path = tmp_path / "certificate.pdf"
    compile_document(
        path, "certificate.typ", {"facts": facts}, empty_pictures(tmp_path, ["budget"])
    )
    assert path.read_bytes().startswith(b"%PDF")
