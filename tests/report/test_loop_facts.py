"""What the report of a campaign states fits together, is said in words that people know, and compiles, whatever the verdict."""

import json
import shutil

import pytest
from compiled_pages import assert_within_margins, pages_of
from made_loop_facts import CAMPAIGNS, HARMONICS, facts_of, plainly
from made_loop_tables import (
    campaign_descriptions,
    effect_entry,
    experiment_rows,
    parameter_table,
    split_rows,
    step_rows,
    verdict_document,
)
from selected import slow_but

from elastocal.diagnosis.verdict import CLASS
from elastocal.effects.catalogue import effects
from elastocal.figures.residuals import before_after
from elastocal.figures.style import save
from elastocal.report.first_page import AT_FAULT, what_to_do
from elastocal.report.loop_facts import write_loop_report


def test_facts_are_json():
    for verdict in CAMPAIGNS.values():
        json.dumps(facts_of(verdict, experiment=experiment_rows()), allow_nan=False)


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


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """One in the place of each."""
    folder = tmp_path_factory.mktemp("figures")
    names = [str(folder / f"{name}.pdf") for name in ("before_after", "arrows", "residuals", "candidates", "confounding")]
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
