"""The facts of a report are consistent and in plain words for every verdict."""

import json
import re
from dataclasses import replace

import pytest
from made_loop_tables import (
    CAMPAIGNS,
    HARMONICS,
    WAVES,
    effect_entry,
    experiment_rows,
    facts_of,
    make_verdict,
    plainly,
    step_rows,
)

from elastocal.diagnosis.verdict import NAMED
from elastocal.report.loop_facts import (
    AT_FAULT,
    TITLES,
    UNCERTAIN_COUNT,
    describe_effect,
    format_cost,
    render_campaign_sentences,
    summarize_effect,
    tabulate_causes,
    tabulate_compliances,
    tabulate_untestable,
)
from elastocal.report.loop_facts import tabulate_steps as table_rows
from elastocal.verdict import Accuracy, BoardErrors, Compliances

WORDS = {
    "adequate": "none of 30 candidate causes is needed",
    "named": "lacks one mechanism: lost motion (backlash) of joint 3 (94 %).",
    "named, location uncertain": (
        "Its location is less certain: joint 3 (80 %) and joint 5 (20 %)."
    ),
    "class": (
        "most probably lost motion (backlash) of joint 3 (94 %). Instead of lost motion "
        "(backlash) it may be bearing tilt or elastic bending and torsion: these "
        "measurements do not distinguish them."
    ),
    "class with a related mechanism": (
        "Instead of lost motion (backlash) it may be a related mechanism"
    ),
    "several": (
        "lacks 2 mechanisms: lost motion (backlash) of joint 3 (94 %; 0.085 mm) and "
        "weight of an undeclared payload (94 %; 0.085 mm)"
    ),
    "unexplained": (
        "a smooth error of unknown cause explains it better than any of 30 candidate "
        "causes"
    ),
    "not_testable": "cannot decide whether a mechanism is missing",
    "fault of the data": "The loads fit as if they were written in kilonewtons.",
}


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_facts_are_json_and_the_verdict_is_in_plain_words(campaign):
    facts = facts_of(CAMPAIGNS[campaign], experiment=experiment_rows())
    said = json.dumps(facts, allow_nan=False, ensure_ascii=False)
    assert WORDS.get(campaign, "") in plainly(" ".join(facts["sentences"]))
    # No sentence has a gap, a double blank or a tag of a template.
    assert not re.search(
        r"  | [.,;:] |\{|None|Undefined|\.\.\"",
        " ".join(facts["sentences"] + facts["now"]),
    )
    assert "{{" not in said and "{%" not in said


def test_a_mechanism_is_most_probable_only_if_no_other_one_is_more_so():
    verdict = CAMPAIGNS["class"]
    mechanisms = {"joint_tilt": 0.97, "other": 0.1} | verdict.probabilities.mechanisms
    probabilities = replace(verdict.probabilities, mechanisms=mechanisms)
    said = render_campaign_sentences(replace(verdict, probabilities=probabilities))
    assert "one mechanism, possibly lost motion" in plainly(said["sentences"][0])


def test_an_effect_that_is_less_probable_than_not_is_not_called_missing():
    verdict = CAMPAIGNS["several"]
    backlash, payload = verdict.effects
    improbable = replace(payload, probability=0.14)
    doubtful = replace(verdict, effects=(backlash, improbable))
    sentences = plainly(" ".join(render_campaign_sentences(doubtful)["sentences"]))
    assert "The declared model lacks 1 mechanism: lost motion" in sentences
    assert (
        "Less probable than not, but in the model, because it fits these measurements "
        "better with it: weight of an undeclared payload (14 %; 0.085 mm)."
    ) in sentences
    assert facts_of(doubtful)["verdict"] == UNCERTAIN_COUNT
    assert facts_of(verdict)["verdict"] == TITLES["several"]


def test_the_advice_follows_from_the_verdict_and_the_gain():
    def now(verdict, experiment=()):
        return render_campaign_sentences(verdict, experiment=experiment)["now"]

    intervals = ((0.15, 0.32), (-0.3, -0.1), (-0.1, 0.3))
    gained, lost, unsure = (
        now(make_verdict(NAMED, [effect_entry()], reduction=interval))[0]
        for interval in intervals
    )
    assert (
        gained.startswith("Use the corrected model")
        and lost.startswith("Do not use")
        and "not certain" in unsure
    )
    assert (
        "the 10 poses of the next experiment, which the report lists"
        in now(CAMPAIGNS["class"], experiment_rows())[1]
    )
    assert (
        "trust the correction only at poses and loads like these"
        in now(CAMPAIGNS["class"])[1]
    )
    assert any(
        "extrapolated" in advice for advice in now(CAMPAIGNS["poses outside the range"])
    )
    assert not any("extrapolated" in advice for advice in now(CAMPAIGNS["named"]))
    assert "Use the declared model" in now(CAMPAIGNS["adequate"])[0]
    assert "loose target" in now(CAMPAIGNS["unexplained"])[0]
    (advice,) = now(replace(CAMPAIGNS["adequate"], kept="frames"))
    assert advice.startswith("Do not use this calibration")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"cost_m": 8.5e-5}, "0.085 mm"),
        # A third of 84 µm is 28 µm; without the effect the error would be 88 µm.
        ({"cost_m": 2.9e-5}, "0.029 mm"),
        ({"cost_m": 1.5e-5, "probability": 0.996}, "0.015 mm: real, negligible"),
        ({"cost_m": 1.5e-5, "probability": 0.7}, "0.015 mm: negligible"),
        ({"cost_m": 4.4e-10, "probability": 0.996}, "below 0.001 mm: real, negligible"),
        ({"cost_m": None}, "cannot be corrected"),
        (
            {"cost_m": None, "name": "setup_step"},
            "an error of the measurement, not of the robot",
        ),
    ],
)
def test_each_cause_states_its_cost_and_a_small_cost_is_negligible(changed, words):
    assert (
        format_cost(replace(effect_entry(), **changed), CAMPAIGNS["named"].heldout)
        == words
    )


def test_causes_are_the_missing_effects_and_other_probable_mechanisms():
    sets = [
        ({"lost_motion": ["joint 3"]}, 0.6),
        ({"joint_tilt": ["joint 2"], "other": [""]}, 0.36),
        ({}, 0.04),
    ]
    rows = tabulate_causes(
        make_verdict(NAMED, [replace(effect_entry(), probability=0.6)], sets=sets)
    )
    assert [(row["name"], plainly(row["words"]), row["cost"]) for row in rows] == [
        ("Lost motion (backlash) of joint 3", "60 %", "0.085 mm"),
        ("Bearing tilt", "36 %", ""),
        ("A related mechanism", "36 %", ""),
        ("Nothing is missing", "4 %", ""),
    ]
    assert (
        tabulate_causes(CAMPAIGNS["unexplained"])[0]["name"]
        == "Something that the catalogue does not have"
    )


def test_a_fault_of_the_data_is_no_effect():
    facts = facts_of(CAMPAIGNS["fault of the data"])
    assert facts["faulty"] and facts["verdict"] == AT_FAULT
    assert (
        facts["now"][1]
        == "Wrong unit: the data fit with newtons for each unit of force written = 1000 N."
    )
    (fault,) = facts["effects"]
    assert [row[:3] for row in fault["parameters"]] == [
        ["newtons for each unit of force written", "1000", "N"],
        ["poses compared", "12", ""],
    ]
    assert [plainly(distance) for distance in fault["evidence"]] == ["500 mm", "100 µm"]
    assert fault["alternatives"] == "a load that is 1000 times larger"
    # A fit to faulty data says nothing about the model.
    assert (
        facts["warnings"] == []
        and facts["probabilities"] == ""
        and facts["held_out"] == ""
    )
    assert not facts_of(CAMPAIGNS["named"])["faulty"]


def test_parameters_have_readable_units_their_source_and_their_location():
    effect = effect_entry()
    heldout = CAMPAIGNS["named"].heldout
    assert describe_effect(effect, heldout)["parameters"] == [
        ["half play", "120.0 ± 3.0", "µrad", "measurements"]
    ]
    # An unidentifiable parameter is counted, but its value is not printed.
    hidden = replace(effect.parameters[0], identifiable=False)
    effect = replace(effect, parameters=(hidden, *effect.parameters[1:]))
    facts = describe_effect(effect, heldout)
    assert (facts["parameters"], facts["held"]) == ([], 1)
    # A quantity of the whole effect, such as its largest sag, has no location.
    effect = effect_entry(
        "link_weight",
        ("link_weight@2", "link_weight@3"),
        (2, 3),
        ("compliance_times_mass",),
    )
    sag = replace(effect.parameters[0], name="link_weight largest_sag", unit="m")
    effect = replace(effect, parameters=(sag, *effect.parameters))
    names = [row[0] for row in describe_effect(effect, heldout)["parameters"]]
    assert names[0] == "largest sag" and names[1].startswith("joint 2: ")
    many = describe_effect(CAMPAIGNS["hundreds of parameters"].effects[0], heldout)
    assert (
        len(many["parameters"]) == 10
        and many["left_out"] == str(len(HARMONICS) * len(WAVES))
        and many["with_angle"]
    )


def test_before_and_after_have_intervals_and_multiples():
    table = table_rows(step_rows(), 5e-5)
    assert table["unit"] == "µm" and [row["kind"] for row in table["rows"]] == [
        "frames",
        "declared",
        "effect",
    ]
    cells = table["rows"][0]["cells"]
    assert cells[1:] == [
        ["180", "[144, 216]", "3.60 × floor"],
        ["270", "–", "5.40 × floor"],
        ["300", "–", "6.00 × floor"],
    ]
    assert table_rows(step_rows(largest_m=0.05), None)["rows"][0]["cells"][0] == [
        "25.000",
        "[20.000, 30.000]",
    ]


def test_an_unidentifiable_compliance_has_no_number_unless_none_is_fitted():
    rows = tabulate_compliances(
        Compliances((0.5, 0.4), (0.48, 0.4), (0.01, 0.0), (True, False))
    )
    assert rows == [
        ["1", "0.500", "0.480 ± 0.010"],
        ["2", "not identifiable", "not identifiable"],
    ]
    assert tabulate_compliances(Compliances((0.5,), (0.5,), (0.0,), (False,))) == [
        ["1", "0.5", "0.5"]
    ]


def test_errors_of_a_board_are_stated_in_the_camera_and_for_the_robot():
    accuracy = Accuracy("robot", 4e-4, 9e-4, None, None, 20, "the campaign's poses")
    verdict = replace(CAMPAIGNS["named"], accuracy=accuracy)
    in_camera = BoardErrors(4e-3, 2.5e-4, 3e-3, 8e-4)
    board = replace(verdict, heldout=replace(verdict.heldout, in_camera=in_camera))
    rows = render_campaign_sentences(board)["accuracy"]
    assert rows[1][0].startswith("measured, the board in the camera")
    assert "before: 4.00 mm, 3 mrad" in rows[1][0]
    assert rows[1][1] == "0.250, 0.8 mrad"
    assert rows[2][0].startswith("predicted, robot alone")
    assert len(render_campaign_sentences(verdict)["accuracy"]) == 2


def test_the_summary_of_an_effect_is_a_whole_sentence():
    """The docstring breaks this sentence over two lines."""
    assert summarize_effect("transmission_harmonic").endswith(
        "by eccentric and uneven parts"
    )


def test_locations_that_cannot_be_tested_are_listed_without_a_preposition():
    reason = "no load in the data"
    keys = ["link_elasticity@2", "link_elasticity@3[torsion]"]
    rows = tabulate_untestable(dict.fromkeys(keys, reason))
    assert rows == [
        ["Elastic bending and torsion", "link 2 and link 3 (torsion)", reason]
    ]
