"""What the report of a campaign states fits together, whatever the verdict, and is said in words that people know."""

import json

import pytest
from made_certificates import made_accuracy
from made_loop_facts import CAMPAIGNS, DIALECT, facts_of, plainly
from made_loop_tables import experiment_rows

from elastocal.report.first_page import AT_FAULT, what_to_do


def test_facts_are_json():
    for verdict in CAMPAIGNS.values():
        json.dumps(facts_of(verdict, experiment=experiment_rows()), allow_nan=False)


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_nothing_is_said_in_a_private_dialect(campaign):
    facts = facts_of(CAMPAIGNS[campaign], experiment=experiment_rows())
    # Reasons of settings are those of the engine.
    said = strings_in({name: value for name, value in facts.items() if name != "settings"})
    assert not [text for text in said if DIALECT.search(text)]
    assert not [text for text in strings_in([facts["sentences"], facts["probabilities"], facts["now"]]) if "_" in text]


@pytest.mark.parametrize("campaign", ["named, not adopted", "class, not adopted"])
def test_an_effect_that_is_not_adopted_is_named_and_no_correction_is_spoken_of(campaign):
    facts = facts_of(CAMPAIGNS[campaign])
    assert "lost motion (backlash) of joint 3" in " ".join(facts["sentences"])
    assert facts["now"][0].startswith("Use the declared model until more is known")
    assert "off by 120 µm RMS" in plainly(facts["now"][0])
    assert not any("corrected model" in advice or "trust the correction" in advice for advice in facts["now"])
    assert facts["held_out_sentence"].startswith("On 10 poses that were not fitted the declared model leaves")
    assert [effect["adopted"] for effect in facts["effects"]] == [False] and facts["effects"][0]["gain"] == ""
    assert [row["kind"] for row in facts["steps"]["rows"]] == ["frames", "declared"]
    assert not facts["splits"]["changed"]
    # An experiment is what resolves it.
    assert any("next experiment" in advice for advice in what_to_do(CAMPAIGNS[campaign], experiment_rows()))


def test_an_effect_that_is_adopted_is_said_to_be_part_of_the_model():
    assert [effect["adopted"] for effect in facts_of(CAMPAIGNS["named"])["effects"]] == [True]


def test_a_predicted_error_says_why_it_is_not_the_measured_one():
    verdict = CAMPAIGNS["named"] | {"accuracy": made_accuracy()}
    stated = facts_of(verdict)["accuracy"]
    assert stated.startswith("Predicted position error") and "0.120 mm is the robot alone" in stated
    assert f"{facts_of(verdict)['headline']['after']} mm at validation poses is the tracker" in stated
    assert facts_of(CAMPAIGNS["named"])["accuracy"] == ""


def test_a_fault_of_the_data_is_no_effect():
    facts = facts_of(CAMPAIGNS["fault of the data"])
    assert facts["faulty"] and facts["verdict"] == AT_FAULT
    assert facts["now"][1] == "Wrong unit: the data fit with newtons for each unit of force written = 1000 N."
    (fault,) = facts["effects"]
    assert [row[:3] for row in fault["parameters"]] == [
        ["newtons for each unit of force written", "1000", "N"],
        ["poses compared", "12", ""],
    ]
    assert plainly(fault["evidence"]) == "As written the data lie 500 mm RMS from the nominal robot, corrected 100 µm."
    assert fault["alternatives"] == "a load that is 1000 times larger"
    # What was fitted to data that are wrong says nothing of the model.
    assert facts["warnings"] == [] and facts["probabilities"] == "" and facts["held_out_sentence"] == ""
    assert not facts_of(CAMPAIGNS["named"])["faulty"]


def strings_in(value):
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else []
    return [text for part in parts for text in strings_in(part)]
