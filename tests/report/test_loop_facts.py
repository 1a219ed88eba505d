"""What the report of a campaign states fits together, is said in words that people know, and compiles, whatever the verdict."""

import json
import re
import shutil

import pytest
from compiled_pages import assert_within_margins, pages_of
from made_loop_facts import CAMPAIGNS, HARMONICS, WAVES, facts_of, plainly
from made_loop_tables import (
    campaign_descriptions,
    effect_entry,
    experiment_rows,
    parameter_table,
    remainder_facts,
    split_rows,
    step_rows,
    verdict_document,
)
from selected import slow_but

from elastocal.application.accuracy import BASE, PREDICTED, Accuracy
from elastocal.diagnosis.verdict import CLASS, NAMED
from elastocal.effects.catalogue import effects
from elastocal.figures.residuals import before_after
from elastocal.figures.style import save
from elastocal.report.loop_facts import (
    AND_MORE,
    AT_FAULT,
    campaign_sentences,
    cause_rows,
    cost_words,
    description,
    effect_facts,
    write_loop_report,
)

WORDS = {
    "adequate": "none of 30 candidate causes is needed",
    "named": "lacks one mechanism: lost motion (backlash) of joint 3 (94 %).",
    "named, location uncertain": "Its location is less certain: joint 3 (80 %) and joint 5 (20 %).",
    "class": "most probably lost motion (backlash) of joint 3 (94 %). Instead of lost motion (backlash) it may be bearing tilt "
    "or elastic bending and torsion: these measurements do not distinguish them.",
    "class with a related mechanism": "Instead of lost motion (backlash) it may be a related mechanism",
    "several": "lacks 2 mechanisms: lost motion (backlash) of joint 3 (94 %; 0.085 mm) and weight of an undeclared payload "
    "(94 %; 0.085 mm)",
    "unexplained": "a smooth error of unknown cause explains it better than any of 30 candidate causes",
    "not_testable": "show neither that something is missing nor that nothing is",
    "fault of the data": "The loads fit as if they were written in kilonewtons.",
}


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_facts_are_json_and_the_verdict_is_said_in_plain_words(campaign):
    facts = facts_of(CAMPAIGNS[campaign], experiment=experiment_rows())
    said = json.dumps(facts, allow_nan=False, ensure_ascii=False)
    assert WORDS.get(campaign, "") in plainly(" ".join(facts["sentences"]))
    # No sentence has a hole, a double blank or what a template leaves behind.
    assert not re.search(r"  | [.,;:] |\{|None|Undefined|\.\.\"", " ".join(facts["sentences"] + facts["now"]))
    assert "{{" not in said and "{%" not in said


@pytest.mark.parametrize(
    ("campaign", "said"),
    [
        ("named", "lacks lost motion (backlash) of joint 3 (94 %), and more than that."),
        ("class", "lacks at least one mechanism, most probably"),
        ("several", "lacks at least 2 mechanisms"),
    ],
)
def test_what_is_left_and_is_a_function_of_the_joints_is_said_beside_what_was_found(campaign, said):
    for remains in (True, False):
        left = {"p_value": 0.003 if remains else 0.2, "remains": remains, "rms_m": 8.3e-5, "rms_std_error_m": 5.8e-6}
        facts = facts_of(CAMPAIGNS[campaign] | {"repeatable": left})
        words = plainly(" ".join(facts["sentences"]))
        stated = "83.0 µm ± 5.80 µm RMS of what is left are a function of the joint angles and have no name."
        assert (said in words, stated in words, facts["verdict"].endswith(AND_MORE)) == (remains, remains, remains)


def test_what_to_do_follows_from_the_verdict_and_from_the_gain():
    def now(verdict, experiment=()):
        return campaign_sentences(verdict, experiment=experiment)["now"]

    ends = ((0.15, 0.32), (-0.3, -0.1), (-0.1, 0.3))
    gained, lost, unsure = (now(verdict_document(NAMED, [effect_entry()], reduction=each))[0] for each in ends)
    assert gained.startswith("Use the corrected model") and lost.startswith("Do not use") and "not certain" in unsure
    assert "the 10 poses of the next experiment, which the report lists" in now(CAMPAIGNS["class"], experiment_rows())[1]
    assert "trust the correction at poses and loads like these only" in now(CAMPAIGNS["class"])[1]
    assert any("extrapolated" in advice for advice in now(CAMPAIGNS["poses outside the range"]))
    assert not any("extrapolated" in advice for advice in now(CAMPAIGNS["named"]))
    assert "Use the declared model" in now(CAMPAIGNS["adequate"])[0]
    assert "loose target" in now(CAMPAIGNS["unexplained"])[0]
    (advice,) = now(CAMPAIGNS["adequate"] | {"kept": "frames"})
    assert advice.startswith("Leave the robot as its file has it")


def test_the_headline_has_the_robot_as_it_was_and_as_it_is_and_its_caption_what_lies_between():
    said = campaign_sentences(CAMPAIGNS["named"])
    assert said["headline_line"] == ["0.171 → 0.084 mm (noise 0.050), RMS position error on 10 validation poses"]
    assert "The declared model, fitted, leaves 0.120 mm." in said["headline_caption"][0] and len(said["cost"]) == 1
    regressed = verdict_document("named", [effect_entry()], remainder=remainder_facts())
    assert campaign_sentences(regressed)["headline_line"] == [
        "0.171 → 0.084 → 0.060 mm (noise 0.050), RMS position error on 10 validation poses: before, by physics, as delivered"
    ]
    assert "noise" not in campaign_sentences(CAMPAIGNS["noise not known"])["headline_line"][0]
    assert campaign_sentences(CAMPAIGNS["fault of the data"])["headline_line"] == []


def test_an_effect_that_validation_poses_do_not_confirm_is_said_to_be_so():
    for gain, said in ((-0.02, True), (0.3, False)):
        verdict = verdict_document(NAMED, [effect_entry() | {"heldout_gain": gain}])
        words = " ".join(campaign_sentences(verdict)["sentences"])
        assert ("does not lower the RMS error of the validation poses (+2 %): they do not confirm it" in words) == said
        assert cause_rows(verdict)[0]["gain"] == ("+2 %" if said else "−30 %")


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


MOSTLY = {
    "left_out_m": "effects that no command contains",
    "form_m": "the form of the model",
    "repeated_m": "each pose's own error and the repeatability of the joints",
    "rms_m": "the uncertainty of the parameters",
}


@pytest.mark.parametrize("part", MOSTLY)
def test_measured_and_predicted_errors_stand_apart_and_the_predicted_one_has_its_largest_part(part):
    stated = Accuracy(BASE, PREDICTED, 1.74e-4, 4e-4, 2e-4, None, "", 9, "some poses").document() | {part: 1.57e-4}
    facts = facts_of(CAMPAIGNS["named"] | {"accuracy": stated})
    (measured, rms, _), (own, predicted, worst) = facts["accuracy"]
    assert measured == "the tracker against the model, at 10 validation poses" and rms == "0.084"
    assert own == "the robot itself, predicted over some poses (9)" and worst == "0.400"
    assert predicted == f"{1e3 * stated['rms_m']:.3f} (95 % sure: below 0.200)"
    assert f"the same frame. It comes mostly from {MOSTLY[part]}." in facts["accuracy_words"]


@pytest.mark.parametrize("campaign", ["named, not adopted", "class, not adopted"])
def test_an_effect_that_is_not_adopted_is_named_and_no_correction_is_spoken_of(campaign):
    facts = facts_of(CAMPAIGNS[campaign])
    assert "lost motion (backlash) of joint 3" in " ".join(facts["sentences"])
    assert facts["now"][0].startswith("Use the declared model until more is known")
    assert "off by 120 µm RMS" in plainly(facts["now"][0])
    assert not any("corrected model" in advice or "trust the correction" in advice for advice in facts["now"])
    assert facts["held_out"].startswith("On 10 poses that were not fitted the declared model leaves")
    assert [effect["adopted"] for effect in facts["effects"]] == [False] and facts["effects"][0]["gain"] is None
    assert [row["kind"] for row in facts["steps"]["rows"]] == ["frames", "declared"]
    assert not facts["splits"]["changed"]


def test_a_fault_of_the_data_is_no_effect():
    facts = facts_of(CAMPAIGNS["fault of the data"])
    assert facts["faulty"] and facts["verdict"] == AT_FAULT
    assert facts["now"][1] == "Wrong unit: the data fit with newtons for each unit of force written = 1000 N."
    (fault,) = facts["effects"]
    assert [row[:3] for row in fault["parameters"]] == [
        ["newtons for each unit of force written", "1000", "N"],
        ["poses compared", "12", ""],
    ]
    assert [plainly(each) for each in fault["evidence"]] == ["500 mm", "100 µm"]
    assert fault["alternatives"] == "a load that is 1000 times larger"
    # What was fitted to data that are wrong says nothing of the model.
    assert facts["warnings"] == [] and facts["probabilities"] == "" and facts["held_out"] == ""
    assert not facts_of(CAMPAIGNS["named"])["faulty"]


def test_every_effect_of_the_catalogue_is_described_without_formulas():
    for name in effects():
        said = description(name)
        assert said and not set("=[]^_") & set(said), said


def test_parameters_stand_in_readable_units_with_what_determines_them_and_of_whom_they_are():
    effect, heldout = effect_entry(), CAMPAIGNS["named"]["heldout"]
    assert effect_facts(effect, heldout)["parameters"] == [["half play", "120.0 ± 3.0", "µrad", "measurements"]]
    # What the measurements do not identify is counted, and no number of it is printed.
    effect["parameters"][0] |= {"identifiable": False}
    facts = effect_facts(effect, heldout)
    assert (facts["parameters"], facts["held"]) == ([], 1)
    # What belongs to an effect as a whole, such as its largest sag, stands without a member.
    effect = effect_entry("link_weight", ("link_weight@2", "link_weight@3"), (2, 3), ("compliance_times_mass",))
    effect["parameters"].insert(0, effect["parameters"][0] | {"name": "link_weight largest_sag", "unit": "m"})
    names = [row[0] for row in effect_facts(effect, heldout)["parameters"]]
    assert names[0] == "largest sag" and names[1].startswith("joint 2: ")
    many = effect_facts(CAMPAIGNS["hundreds of parameters"]["effects"][0], heldout)
    assert len(many["parameters"]) == 10 and many["left_out"] == str(len(HARMONICS) * len(WAVES)) and many["with_angle"]


def test_what_a_regression_adds_is_said_with_shares_intervals_and_where_it_corrects_nothing():
    def said(remainder):
        return plainly(" ".join(campaign_sentences(CAMPAIGNS["named"] | {"remainder": remainder})["remainder"]))

    words = said(remainder_facts(outside=3))
    assert "RMS error of 60.0 µm (95 %: 50.0 µm to 72.0 µm) instead of 84.0 µm: a change of the error by −31 to +5 %" in words
    assert "the effects explain 51.0 % and the regression 24.0 %; 25.0 % is left" in words
    assert "± 100 µm within the range of the fitted poses, ± 400 µm outside (median of a coordinate), hold 95 %" in words
    assert "At the 3 poses beyond the fitted joints or loads it corrects nothing" in words
    assert "outside" not in said(remainder_facts()) and said(None) == ""
    none = said(remainder_facts() | {"regression": ""})
    assert none.startswith("What the final model leaves shows no pattern") and none.endswith("none is used.")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """One in the place of each."""
    folder = tmp_path_factory.mktemp("figures")
    names = [str(folder / f"{name}.pdf") for name in ("before_after", "arrows", "candidates")]
    save(before_after(step_rows(), 5e-5), names[0], str(folder / "before_after.png"))
    return [names[0], *(shutil.copy(names[0], name) for name in names[1:])]


@pytest.fixture
def pages(monkeypatch):
    return pages_of(monkeypatch)


@pytest.mark.parametrize("campaign", slow_but(["named", "fault of the data"], CAMPAIGNS))
def test_every_verdict_compiles_within_its_margins(campaign, pictures, pages, tmp_path):
    path = tmp_path / "report.pdf"
    write_loop_report(str(path), facts_of(CAMPAIGNS[campaign]), pictures)
    assert path.read_bytes().startswith(b"%PDF")
    assert_within_margins(pages)


def test_long_names_wrap(pictures, pages, tmp_path):
    long = "a_campaign_with_a_name_that_nobody_would_type_twice_but_that_a_script_made_" + "x1_" * 20
    effect = effect_entry(parameters=["compliance_times_mass_at_end_of_link_" + "and_of_another_" * 8])
    effect["alternatives"] = sorted(effects())
    verdict = verdict_document(
        CLASS, [effect], [f"{long}: is a long name"], campaign=long, held=[f"link_geometry@{k} dx" for k in range(1, 7)]
    )
    changed = {
        "descriptions": campaign_descriptions(
            long, f"{long} robot", f"{long}_static", targets=[f"target_{k}_of_a_long_bar" for k in range(2)]
        ),
        "steps": step_rows(["lost_motion", ", ".join(HARMONICS[:5])]),
        "experiment": experiment_rows() + experiment_rows("transmission_harmonic"),
        "parameters": parameter_table(
            [f"link_geometry@{k} {name}" for k in range(1, 9) for name in ("dx", "dy", "dz", "rx", "ry", "rz")]
        ),
        "splits": split_rows(blocks=12),
    }
    write_loop_report(str(tmp_path / "report.pdf"), facts_of(verdict, **changed), pictures)
    assert_within_margins(pages)


def test_a_rerun_gives_the_same_bytes(pictures, tmp_path):
    for run in "ab":
        write_loop_report(str(tmp_path / f"{run}.pdf"), facts_of(CAMPAIGNS["class"], experiment=experiment_rows()), pictures)
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
