"""The report of the blind proof states what its tables hold: what is reached, what is missed, what has no case."""

import json

import pandas as pd
import pytest
from made_blind_documents import oracle, silence, truth
from made_blind_facts import MANIFEST, MEASURED, PROOF, facts_of, tables
from scipy.stats import beta

from elastocal_proof.report.blind_facts import blind_facts


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    return tables(tmp_path_factory.mktemp("tables"), *PROOF, follow_up=MEASURED)


@pytest.fixture(scope="module")
def facts(given):
    return blind_facts(given, MANIFEST, "quick", 7)


def test_targets_are_reached_or_missed_with_their_figures(facts):
    rows = {row[0]: row[1:] for row in facts["targets"]["proof"]}
    assert rows["detected at 50"][:2] == ["1 of 2", "50.0 %"] and rows["detected at 50"][-1] == "missed"
    assert rows["effect adopted and held-out RMS worse by over two standard errors"][-1] == "reached"
    assert any(line.startswith("detected at 50: 50.0 % (1.3–98.7 %), target at least 98 %") for line in facts["missed"])
    ends = [row[-1] for row in rows.values()]
    # Four hard settings, pairs, stated probabilities and their 95 % sets, and parameters of effects.
    assert rows["95 % intervals of effects' parameters"][-1] == "no case"
    assert rows["false alarms, 3 kN"][-1] == "no case"
    without = ends.count("no case")
    assert facts["verdict"].startswith(f"{ends.count('reached')} of {len(ends) - without} figures")
    assert len(facts["missed"]) == ends.count("missed")


def test_robots_of_the_proof_and_of_tuning_are_kept_apart(facts):
    assert facts["robots"] == {"proof": "m900ib700", "tuned": "kuka"} and facts["proof"]
    assert {row[0]: row[1] for row in facts["targets"]["tuned"]}["detected at 50"] == "1 of 1"


def test_a_run_without_a_robot_of_the_proof_proves_nothing(tmp_path):
    facts = facts_of(tmp_path, (truth(robot="kuka"), silence(), oracle(1.0)))
    assert not facts["proof"] and "proves nothing" in facts["verdict"]


def test_shares_of_the_verdicts_on_effects_outside_of_the_catalogue_add_up(facts):
    (row,) = facts["outside"]
    assert row == ["refraction", "200", "1", "100", "0", "0", "0", "0"]


def test_cases_are_counted_by_group_and_robot_with_their_sum(facts):
    counts = facts["counts"]
    assert counts["heads"] == ["cases", "kuka", "m900ib700"]
    assert counts["rows"] == [
        ["no effect", "0", "3"],
        ["one effect of the catalogue", "1", "3"],
        ["one effect outside of the catalogue", "0", "1"],
        ["all", "1", "7"],
    ]


def test_effects_have_their_shares_with_intervals_and_their_size(facts):
    rows = {row[0]: row for row in facts["effects"]}
    low, high = (100 * beta.ppf(share, *of) for share, of in ((0.025, (1, 2)), (0.975, (2, 1))))
    half = f"50 ({low:.0f}–{high:.0f})"
    assert rows["payload"] == ["payload", "50", "2", half, half, half, "100 (16–100)", "60.0 µm", "0.50"]
    # What is absorbed has no size beyond the joint compliances: it is that of the raw signal.
    assert rows["force scale"][1] == "50 raw"


def test_hard_settings_have_their_rates_of_detection_and_of_wrong_names(given):
    row = {
        "robots": "proof",
        "setting": "outliers_1_percent",
        "level": 0.0,
        "cases": 8,
        "low": 0.01,
        "high": 0.526,
        "held": 2,
        "wrong": 1,
    }
    settings = pd.DataFrame([row | {"kind": "no effect", "rate": 0.125}, row | {"kind": "effect", "level": 200.0, "rate": 0.5}])
    other = pd.DataFrame([row | {"kind": "effect", "rate": 1.0, "robots": "tuned"}])
    changed = given | {"settings": pd.concat([settings, other])}
    assert blind_facts(changed, "", "quick", 7)["settings"] == [
        ["1 % outliers", "no effect", "8", "12 (1–53)", "–", "12"],
        ["1 % outliers", "effect at 200", "8", "50 (1–53)", "25", "12"],
    ]


def test_facts_can_be_written_as_json_without_a_number_that_is_none(tmp_path, facts):
    assert json.loads(json.dumps(facts, allow_nan=False)) == facts
    json.dumps(facts_of(tmp_path, *PROOF[-1:]), allow_nan=False)
