"""The report of a campaign compiles whatever the verdict, says it in words, and keeps within its margins."""

import json
import re
from importlib import resources

import pytest
import typst
from made_loop_tables import (
    campaign_descriptions,
    candidate_table,
    confounding_table,
    effect_entry,
    experiment_rows,
    fault_entry,
    parameter_table,
    probabilities,
    residual_table,
    split_rows,
    step_rows,
    verdict_document,
)
from matplotlib.image import imread

from elastocal.diagnosis import verdict as verdicts
from elastocal.effects.catalogue import effects
from elastocal.figures import candidates as of_candidates
from elastocal.figures.before_after import before_after
from elastocal.figures.residuals import arrows, residuals
from elastocal.figures.style import save
from elastocal.report.first_page import AT_FAULT, TITLES, probability_sentence, sentences, what_to_do
from elastocal.report.loop_facts import (
    description,
    effect_facts,
    held_rows,
    loop_facts,
    range_sentence,
    untestable_rows,
)
from elastocal.report.loop_facts import (
    split_rows as rows_of_splits,
)
from elastocal.report.loop_facts import (
    step_rows as table_rows,
)
from elastocal.report.loop_pages import write_loop_report

ADEQUATE, NAMED, CLASS, SEVERAL = verdicts.ADEQUATE, verdicts.NAMED, verdicts.CLASS, verdicts.SEVERAL
UNEXPLAINED, NOT_TESTABLE = verdicts.UNEXPLAINED, verdicts.NOT_TESTABLE
HARMONICS = [f"transmission_harmonic@{joint}[orders {band}]" for joint in range(1, 7) for band in ("1-2", "3-6", "7-12")]
WAVES = [f"{wave}_{order}q" for order in range(1, 7) for wave in ("cos", "sin")]
TWO_PLACES = [("joint 3", 0.8), ("joint 5", 0.2)]
CAMPAIGNS = {
    "adequate": verdict_document(ADEQUATE, sets=[({}, 0.97), ({"lost_motion": ["joint 3"]}, 0.02)]),
    "named": verdict_document(NAMED, [effect_entry()]),
    "named, location uncertain": verdict_document(NAMED, [effect_entry(locations=TWO_PLACES)]),
    "class": verdict_document(CLASS, [effect_entry(alternatives=["joint_tilt", "link_elasticity"])]),
    "class with a related mechanism": verdict_document(CLASS, [effect_entry(alternatives=["other"])]),
    "several": verdict_document(SEVERAL, [effect_entry(), effect_entry("payload", ["payload"], (), ["mass"])]),
    "named, not adopted": verdict_document(NAMED, [effect_entry(adopted=False)]),
    "class, not adopted": verdict_document(CLASS, [effect_entry(alternatives=["joint_tilt"], adopted=False)]),
    "unexplained": verdict_document(UNEXPLAINED, sets=[({"other": ["joint 2"]}, 0.9), ({}, 0.1)]),
    "not_testable": verdict_document(NOT_TESTABLE, sets=[({}, 1.0)]),
    "fault of the data": verdict_document(NAMED, [fault_entry()], ["the fit of the final model did not converge"]),
    "noise not known": verdict_document(ADEQUATE, noise="residual", warnings=["no repeats and no declared noise"]),
    "hundreds of parameters": verdict_document(SEVERAL, [effect_entry("transmission_harmonic", HARMONICS, range(1, 7), WAVES)]),
    "poses outside the range": verdict_document(NAMED, [effect_entry()], outside=3),
}
WORDS = {
    "adequate": "none of 30 candidate causes is needed",
    "named": "lacks one mechanism: lost motion (backlash) of joint 3.",
    "named, location uncertain": "Its location is less certain: joint 3 (80 %) and joint 5 (20 %).",
    "class": "most probably lost motion (backlash) of joint 3. Instead of lost motion (backlash) it may be bearing tilt or "
    "elastic bending and torsion: these measurements do not distinguish them.",
    "class with a related mechanism": "Instead of lost motion (backlash) it may be a related mechanism",
    "several": "lacks 2 mechanisms, each with its probability: lost motion (backlash) of joint 3 (94 %) and weight of an "
    "undeclared payload (94 %)",
    "unexplained": "a smooth error of unknown cause explains it better than any of 30 candidate causes",
    "not_testable": "show neither that something is missing nor that nothing is",
    "fault of the data": "The loads fit as if they were written in kilonewtons.",
}
# The private dialect of earlier versions, and words of the table in the design.
DIALECT = re.compile(
    r"\b(akin|rivals?|stands? out|looks?|doubts?|cannot tell|told from|tell it from|tell them|family-wise|weigh(ed|s)?|wild|"
    r"tame|class|readings?|test poses|explainable|makes? a residual)\b",
    re.IGNORECASE,
)


def facts_of(verdict, **changed):
    found = [effect["name"] for effect in verdict["effects"] if effect["adopted"]]
    given = {
        "steps": step_rows(effects=found),
        "splits": split_rows(changed=bool(found)),
        "experiment": [],
        "table": residual_table(),
        "descriptions": campaign_descriptions(),
        "parameters": parameter_table(),
    }
    return loop_facts(verdict, **given | changed)


def plainly(text):
    return text.replace("\u00a0", " ")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder, table, candidates = tmp_path_factory.mktemp("figures"), residual_table(), candidate_table()
    drawn = {
        "before_after": before_after(step_rows(), 5e-5),
        "arrows": arrows(table),
        "residuals": residuals(table),
        "candidates": of_candidates.probabilities(probabilities(), candidates),
        "confounding": of_candidates.confounding(candidates, confounding_table(candidates)),
    }
    for name, figure in drawn.items():
        save(figure, str(folder / f"{name}.pdf"), str(folder / f"{name}.png"))
    return [str(folder / f"{name}.pdf") for name in drawn]


@pytest.fixture
def pages(monkeypatch):
    """The pages of every report that is compiled, as pixels too."""
    seen, compiled = [], typst.compile

    def compile_both(source, output, format, root):
        # More than one page needs a pattern to write to.
        compiled(source, output=f"{root}/page-{{0p}}.png", format="png", root=root, ppi=60)
        seen.extend(imread(file) for file in sorted(source.parent.glob("page-*.png")))
        return compiled(source, output=output, format=format, root=root)

    monkeypatch.setattr(typst, "compile", compile_both)
    return seen


def test_each_verdict_has_its_words():
    assert set(TITLES) == {ADEQUATE, NAMED, CLASS, SEVERAL, UNEXPLAINED, NOT_TESTABLE}


@pytest.mark.parametrize("campaign", WORDS)
def test_the_verdict_is_said_in_plain_words(campaign):
    assert WORDS[campaign] in plainly(" ".join(sentences(CAMPAIGNS[campaign])))


def strings_in(value):
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, (list, tuple)) else []
    return [text for part in parts for text in strings_in(part)]


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_nothing_is_said_in_a_private_dialect(campaign):
    facts = facts_of(CAMPAIGNS[campaign], experiment=experiment_rows())
    # Reasons of settings are those of the engine.
    said = strings_in({name: value for name, value in facts.items() if name != "settings"})
    assert not [text for text in said if DIALECT.search(text)]
    assert not [text for text in strings_in([facts["sentences"], facts["probabilities"], facts["now"]]) if "_" in text]


def test_the_pages_speak_no_private_dialect():
    source = resources.files("elastocal.report").joinpath("loop.typ").read_text(encoding="utf-8")
    assert not [line for line in source.splitlines() if DIALECT.search(line)]


def test_probabilities_are_said_by_hypothesis_with_the_rest():
    sets = [({"link_weight": ["joint 2"]}, 0.94), ({"transmission_harmonic": ["joint 2 orders 1-2"]}, 0.05), ({}, 0.0001)]
    assert plainly(probability_sentence(probabilities(sets))) == (
        "94 % gravity sag of joint 2, 5 % gear transmission error of joint 2 (orders 1-2), 1 % something else"
    )
    sets = [({"link_weight": ["joint 2"], "other": ["base"]}, 0.7), ({"other": ["joint 2"]}, 0.3)]
    assert plainly(probability_sentence(probabilities(sets))) == (
        "70 % gravity sag of joint 2 or a related mechanism, 30 % something that the catalogue does not have"
    )


def test_what_to_do_follows_from_the_verdict_and_from_the_gain():
    gained, lost, unsure = (
        what_to_do(verdict_document(NAMED, [effect_entry()], reduction=ends), [])[0]
        for ends in ((0.15, 0.32), (-0.3, -0.1), (-0.1, 0.3))
    )
    assert gained.startswith("Use the corrected model") and lost.startswith("Do not use") and "not certain" in unsure
    assert "the 10 poses of the section on the next experiment" in what_to_do(CAMPAIGNS["class"], experiment_rows())[1]
    assert "trust the correction at poses and loads like these only" in what_to_do(CAMPAIGNS["class"], [])[1]
    assert any("extrapolated" in advice for advice in what_to_do(CAMPAIGNS["poses outside the range"], []))
    assert not any("extrapolated" in advice for advice in what_to_do(CAMPAIGNS["named"], []))
    assert "Use the declared model" in what_to_do(CAMPAIGNS["adequate"], [])[0]
    assert "loose target" in what_to_do(CAMPAIGNS["unexplained"], [])[0]


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


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_every_verdict_compiles_within_its_margins(campaign, pictures, pages, tmp_path):
    path = tmp_path / "report.pdf"
    write_loop_report(str(path), facts_of(CAMPAIGNS[campaign]), pictures)
    assert path.read_bytes().startswith(b"%PDF")
    assert_within_margins(pages)


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


def test_facts_are_json():
    for verdict in CAMPAIGNS.values():
        json.dumps(facts_of(verdict, experiment=experiment_rows()), allow_nan=False)


def test_hundreds_of_parameters_are_summarised():
    found = effect_facts(CAMPAIGNS["hundreds of parameters"]["effects"][0])
    assert len(found["parameters"]) == 10 and "10 of 216 parameters" in found["rest"]
    # The farthest from zero in standard errors, which are alike here, is the last.
    assert found["parameters"][0][0] == "joint 6: orders 7-12: sin 6q"
    assert found["members"] == "joints 1, 2, 3, 4, 5 and 6: orders 1-2, orders 3-6, orders 7-12"


def test_what_belongs_to_an_effect_as_a_whole_stands_without_a_member():
    effect = effect_entry("link_weight", ("link_weight@2", "link_weight@3"), (2, 3), ("compliance_times_mass",))
    effect["parameters"].insert(0, effect["parameters"][0] | {"name": "link_weight largest_sag", "unit": "m"})
    names = [row[0] for row in effect_facts(effect)["parameters"]]
    assert names[0] == "largest sag" and names[1].startswith("joint 2: ")


def test_few_parameters_are_all_there_in_readable_units():
    assert effect_facts(effect_entry())["parameters"] == [["half play", "120.0 ± 3.0", "µrad", "measurements"]]


def test_held_parameters_are_gathered_by_owner():
    rows = held_rows(["joint_offset@1 offset", "link_geometry@1 dz", "link_geometry@1 ry"])
    assert rows == [["Zero offset of joint 1", "offset"], ["Geometric error of link 1", "dz, ry"]]


def test_what_only_the_prior_determines_is_listed_as_not_identified():
    left = "joint_offset@3 offset"
    facts = facts_of(CAMPAIGNS["named"], parameters=parameter_table(["joint_offset@2 offset", left], by_prior=[left]))
    assert facts["held"] == [["Zero offset of joint 3", "offset"]]
    assert [row[0] for row in facts["others"]["rows"]] == ["Zero offset of joint 2"]
    effect = effect_entry()
    effect["parameters"][0] |= {"std_error": 9e-6}
    assert effect_facts(effect)["parameters"][0][3] == "mostly the prior"


def test_candidates_that_cannot_be_tested_are_gathered_by_reason():
    reason = "4{} angles of joint {} where 72 are needed"
    harmonics = {f"transmission_harmonic@{k}[orders 13-18]": reason.format(k, k) for k in (1, 2)}
    assert untestable_rows(CAMPAIGNS["named"]["untestable"] | harmonics) == [
        ["Hysteresis", "joints 1, 2 and 3", "no direction of approach in the data"],
        ["Drift of the tracker or of the robot's foot", "–", "no time in the data"],
        ["Gear transmission error", "joints 1 and 2: orders 13-18", "too few different joint angles"],
    ]


def test_errors_of_blocks_stand_beside_those_of_held_out_poses():
    facts = facts_of(CAMPAIGNS["named"])["splits"]
    assert [row["name"] for row in facts["rows"]] == [
        "validation poses (held out)",
        "every block of joint space in turn",
        *(f"block of joint space {k}" for k in range(1, 5)),
    ]
    assert facts["rows"][1]["cells"] == [["120", "[96, 156]"], ["80", "[64, 104]"], ["33 %", "[23, 43]"]]
    # One quantity has one interval: that of the table before and after, and of the first page.
    declared = next(step for step in step_rows() if step["kind"] == "declared")
    ends = [f"{1e6 * declared[f'heldout_rms_m_{end}']:.0f}" for end in ("low", "high")]
    assert facts["rows"][0]["cells"][0][1] == f"[{ends[0]}, {ends[1]}]"
    assert facts["rows"][0]["cells"][2][1] == "[15, 32]"
    # Without an effect there is nothing to compare.
    adequate = facts_of(CAMPAIGNS["adequate"])["splits"]
    assert not adequate["changed"] and [len(row["cells"]) for row in adequate["rows"]] == [1] * 6
    many = rows_of_splits(split_rows(blocks=30))
    assert len(many["rows"]) == 2 and many["left_out"] == 30


def test_poses_outside_the_fitted_range_are_told_apart():
    within, outside = (plainly(range_sentence(CAMPAIGNS[name]["heldout"])) for name in ("named", "poses outside the range"))
    assert within.startswith(
        "All 10 validation poses lie within the range of the fitted poses. With 95 % confidence at least 74 %"
    )
    assert outside.startswith("3 of 10 validation poses lie outside the range")
    assert "120 µm before and 84.0 µm after outside that range" in outside


def test_every_setting_is_listed_with_value_and_reason():
    rows = facts_of(CAMPAIGNS["named"])["settings"]
    assert len(rows) == len(CAMPAIGNS["named"]["settings"]) and all(map(all, rows))
    assert ["alarm level", "0.02"] in [row[:2] for row in rows]
    assert ["scales", "0.01, 0.03, 0.1, 0.3, 1"] in [row[:2] for row in rows]


def test_where_nothing_is_proposed_the_reason_is_said():
    said = facts_of(verdict_document(NAMED, [effect_entry()], next_experiment={"reason": "nothing is ambiguous"}))["experiment"]
    assert said["sentence"] == "No further measurement is proposed: nothing is ambiguous." and said["rows"] == []
    told = {"sentence": "10 poses separate joint_tilt from link_weight.", "reason": ""}
    facts = facts_of(verdict_document(CLASS, [effect_entry(alternatives=["other"])], next_experiment=told))
    assert facts["experiment"]["sentence"] == "10 poses separate bearing tilt from gravity sag."
    assert facts_of(CAMPAIGNS["named"])["experiment"]["sentence"] == ""


def test_every_effect_of_the_catalogue_is_described_without_formulas():
    for name in effects():
        said = description(name)
        assert said and not set("=[]^_") & set(said), said


def test_before_and_after_have_intervals_and_multiples():
    table = table_rows(step_rows(), 5e-5)
    assert table["unit"] == "µm" and [row["kind"] for row in table["rows"]] == ["frames", "declared", "effect"]
    cells = table["rows"][0]["cells"]
    assert cells[1] == ["180", "[144, 216]", "3.60 × floor"]
    assert cells[2] == ["270", "≥ 216", "5.40 × floor"]
    assert cells[3] == ["300", "–", "6.00 × floor"]
    assert table_rows(step_rows(largest_m=0.05), None)["rows"][0]["cells"][0] == ["25.000", "[20.000, 30.000]"]


def test_what_was_measured_is_told_apart_for_fitted_and_held_out_poses():
    facts = facts_of(CAMPAIGNS["named"], descriptions=campaign_descriptions(held_out="another"))
    measured = {name: (training, held_out) for name, training, held_out in facts["measured"]}
    assert measured["campaign"] == ("made_up", "another")
    assert measured["poses"] == ("20 poses in 1 session", "10 poses in 1 session")
    assert measured["loads"][0].startswith("1 load of 500 N on 50")
    assert facts["method"]["where"] == " of another campaign (another)"


def test_the_next_experiment_is_in_degrees_and_says_what_it_separates():
    facts = facts_of(CAMPAIGNS["class"], experiment=experiment_rows(count=3))["experiment"]
    assert facts["heads"] == [
        "point",
        *(f"q{k} °" for k in range(1, 7)),
        "fx N",
        "fy N",
        "fz N",
        "mx N·m",
        "my N·m",
        "mz N·m",
        "separation",
    ]
    assert facts["rows"][2] == [
        "6DoF",
        "−5.7",
        "−11.5",
        "−17.2",
        "−22.9",
        "−28.6",
        "−34.4",
        "910",
        "0",
        "−412",
        "−206",
        "0",
        "455",
        "12.0",
    ]
    unloaded = [row | dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), 0.0) for row in experiment_rows()]
    assert facts_of(CAMPAIGNS["class"], experiment=unloaded)["experiment"]["heads"][-2:] == ["q6 °", "separation"]


def test_the_side_of_the_approach_and_reference_weights_are_asked_for():
    sides = {f"approach{joint}": side for joint, side in enumerate((1.0, -1.0, 0.0, 1.0, 1.0, -1.0), 1)}
    rows = [row | sides | {"reference_weight_kg": 25.0} for row in experiment_rows(count=2)]
    told = facts_of(CAMPAIGNS["class"], experiment=rows)["experiment"]
    assert told["heads"][-3:] == ["approach", "weight kg", "separation"] and told["approach"]
    assert told["rows"][0][-3:] == ["+−0++−", "25.0", "10.0"]


def assert_within_margins(pages):
    assert pages
    for page in pages:
        width = page.shape[1]
        # Margins of 22 mm on a page of 210 mm; a little of it for the edges of letters.
        margin = int(width * 20 / 210)
        assert (page[:, :margin, :3] > 0.99).all() and (page[:, -margin:, :3] > 0.99).all()
