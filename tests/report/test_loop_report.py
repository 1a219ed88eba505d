"""The report of a campaign compiles whatever the verdict, says it in words, and keeps within its margins."""

import json

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
    residual_table,
    step_rows,
    verdict_document,
)
from matplotlib.image import imread

from elastocal.effects.catalogue import effects
from elastocal.figures.before_after import before_after
from elastocal.figures.candidates import confounding, scree
from elastocal.figures.residuals import arrows, residuals
from elastocal.figures.style import save
from elastocal.report.loop_facts import (
    TITLES,
    description,
    effect_facts,
    held_rows,
    loop_facts,
    sentences,
)
from elastocal.report.loop_facts import (
    step_rows as table_rows,
)
from elastocal.report.loop_pages import write_loop_report
from elastocal.verdict import ADEQUATE, CLASS, NAMED, NOT_TESTABLE, SEVERAL, UNEXPLAINED

HARMONICS = [f"transmission_harmonic@{joint}[orders {band}]" for joint in range(1, 7) for band in ("1-2", "3-6", "7-12")]
WAVES = [f"{wave}_{order}q" for order in range(1, 7) for wave in ("cos", "sin")]
CAMPAIGNS = {
    "adequate": verdict_document(ADEQUATE),
    "named": verdict_document(NAMED, [effect_entry()]),
    "named, not where": verdict_document(NAMED, [effect_entry(alternatives=["lost_motion@5"])]),
    "class": verdict_document(CLASS, [effect_entry(alternatives=["joint_tilt@2", "link_elasticity@1+2[one section]"])]),
    "class by doubts": verdict_document(CLASS, [effect_entry(doubted=["its size goes with the load"])]),
    "class by both": verdict_document(
        CLASS,
        [effect_entry(alternatives=["joint_tilt@2"], doubted=["its size goes with the load", "its size goes with the time"])],
    ),
    "several": verdict_document(SEVERAL, [effect_entry(), effect_entry("payload", ["payload"], (), ["mass"])]),
    "unexplained": verdict_document(UNEXPLAINED, warnings=["the residual is 5 times the noise"]),
    "not_testable": verdict_document(NOT_TESTABLE),
    "fault of the data": verdict_document(NAMED, [fault_entry()]),
    "unexplained with effects": verdict_document(UNEXPLAINED, [effect_entry()], rejected_after=True),
    "noise not known": verdict_document(ADEQUATE, noise="residual", warnings=["no repeats and no declared noise"]),
    "hundreds of parameters": verdict_document(SEVERAL, [effect_entry("transmission_harmonic", HARMONICS, range(1, 7), WAVES)]),
}
WORDS = {
    "adequate": "none of 30 candidates stands out",
    "named": "lost motion in joint 3",
    "named, not where": "These data show it, but not where: instead it may be lost motion in joint 5.",
    "class": "cannot tell from it: joint tilt in joint 2 and link elasticity in links 1 and 2, one section",
    "class by doubts": "lacks one effect: lost motion in joint 3, or something akin to it, "
    "for it departs from its law: its size goes with the load.",
    "class by both": "lost motion in joint 3, or one that these data cannot tell from it: joint tilt in joint 2, "
    "or something akin to it, for it departs from its law: its size goes with the load and its size goes with the time.",
    "several": "lacks 2 effects: lost motion in joint 3 and payload",
    "unexplained": "the catalogue does not account for it",
    "not_testable": "These data can test nothing",
    "fault of the data": "The loads look as if they were written in kilonewtons.",
    "unexplained with effects": "too little to be the cause",
    "noise not known": "cannot be held against the noise",
}


def facts_of(verdict, **changed):
    found = [effect["name"] for effect in verdict["effects"] if effect["family"] != "data"]
    given = {
        "steps": step_rows(effects=found, controls=["joint_offset@4"] if found else []),
        "experiment": [],
        "table": residual_table(),
        "candidates": candidate_table(),
        "descriptions": campaign_descriptions(),
        "parameters": parameter_table(),
        "replicates": 2000,
    }
    return loop_facts(verdict, **given | changed)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder, table, candidates = tmp_path_factory.mktemp("figures"), residual_table(), candidate_table()
    drawn = {
        "before_after": before_after(step_rows(), 5e-5),
        "arrows": arrows(table),
        "residuals": residuals(table),
        "candidates": scree(candidates),
        "confounding": confounding(candidates, confounding_table(candidates)),
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
    assert WORDS[campaign] in " ".join(sentences(CAMPAIGNS[campaign], 30))


def test_doubts_are_said_of_a_class_that_has_them_and_rivals_of_one_that_has_rivals():
    of_rivals, of_doubts = (" ".join(sentences(CAMPAIGNS[name], 30)) for name in ("class", "class by doubts"))
    assert "akin" not in of_rivals and "cannot tell" not in of_doubts


@pytest.mark.parametrize("campaign", CAMPAIGNS)
def test_every_verdict_compiles_within_its_margins(campaign, pictures, pages, tmp_path):
    path = tmp_path / "report.pdf"
    write_loop_report(str(path), facts_of(CAMPAIGNS[campaign]), pictures)
    assert path.read_bytes().startswith(b"%PDF")
    assert_within_margins(pages)


def test_a_fault_of_the_readings_is_no_effect():
    facts = facts_of(CAMPAIGNS["fault of the data"])
    assert facts["faulty"] and facts["verdict"] == "named, the readings are at fault"
    assert facts["effects"][0]["parameters"] == [["newtons for each unit of force written", "1000", "N"]]
    assert not facts_of(CAMPAIGNS["named"])["faulty"]


def test_long_names_wrap(pictures, pages, tmp_path):
    long = "a_campaign_with_a_name_that_nobody_would_type_twice_but_that_a_script_made_" + "x1_" * 20
    effect = effect_entry(parameters=["compliance_times_mass_at_end_of_link_" + "and_of_another_" * 8])
    effect["alternatives"] = HARMONICS
    verdict = verdict_document(
        CLASS, [effect], [f"{long}: is a long name"], campaign=long, held=[f"link_geometry@{k} dx" for k in range(1, 7)]
    )
    changed = {
        "descriptions": campaign_descriptions(
            long, f"{long} robot", f"{long}_static", targets=[f"target_{k}_of_a_long_bar" for k in range(2)]
        ),
        "steps": step_rows(["lost_motion"], [", ".join(HARMONICS[:5])]),
        "experiment": experiment_rows() + experiment_rows("transmission_harmonic"),
        "parameters": parameter_table(
            [f"link_geometry@{k} {name}" for k in range(1, 9) for name in ("dx", "dy", "dz", "rx", "ry", "rz")]
        ),
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
    assert found["members"].startswith("joint 1: orders 1-2, orders 3-6, orders 7-12; joint 2:")


def test_few_parameters_are_all_there_in_readable_units():
    assert effect_facts(effect_entry())["parameters"] == [["half play", "120.0 ± 3.0", "µrad"]]


def test_held_parameters_are_gathered_by_owner():
    rows = held_rows(["joint_offset@1 offset", "link_geometry@1 dz", "link_geometry@1 ry"])
    assert rows == [["joint offset in joint 1", "offset"], ["link geometry in link 1", "dz, ry"]]


def test_every_effect_of_the_catalogue_is_described_without_formulas():
    for name in effects():
        said = description(name)
        assert said and not set("=[]^_") & set(said), said


def test_before_and_after_have_intervals_and_multiples():
    table = table_rows(step_rows(), 5e-5)
    assert table["unit"] == "µm" and [row["kind"] for row in table["rows"]] == ["frames", "declared", "effect", "control"]
    cells = table["rows"][0]["cells"]
    assert cells[1] == ["180", "[144, 216]", "3.60 × floor"]
    assert cells[2] == ["270", "≥ 216", "5.40 × floor"]
    assert cells[3] == ["300", "–", "6.00 × floor"]
    assert table_rows(step_rows(largest_m=0.05), None)["rows"][0]["cells"][0] == ["25.000", "[20.000, 30.000]"]


def test_what_was_measured_tells_training_from_held_out():
    facts = facts_of(CAMPAIGNS["named"], descriptions=campaign_descriptions(held_out="another"))
    measured = {name: (training, held_out) for name, training, held_out in facts["measured"]}
    assert measured["campaign"] == ("made_up", "another")
    assert measured["poses"] == ("20 poses in 1 session", "10 poses in 1 session")
    assert measured["loads"][0].startswith("1 load of 500 N on 50")
    assert facts["method"]["where"] == " of another campaign (another)"


def test_the_next_experiment_is_in_degrees_and_says_what_it_is_worth():
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
        "worth",
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
        "1.30",
    ]
    unloaded = [row | dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), 0.0) for row in experiment_rows()]
    assert facts_of(CAMPAIGNS["class"], experiment=unloaded)["experiment"]["heads"][-2:] == ["q6 °", "worth"]


def test_controls_are_held_against_what_was_found():
    assert "joint offset in joint 4 (2 more parameters) leaves" in facts_of(CAMPAIGNS["named"])["controls"].replace(
        "\u00a0", " "
    )
    assert facts_of(CAMPAIGNS["adequate"])["controls"] == ""


def assert_within_margins(pages):
    assert pages
    for page in pages:
        width = page.shape[1]
        # Margins of 22 mm on a page of 210 mm; a little of it for the edges of letters.
        margin = int(width * 20 / 210)
        assert (page[:, :margin, :3] > 0.99).all() and (page[:, -margin:, :3] > 0.99).all()
