"""The report of the blind proof states what its tables hold: what is reached, what is missed, what has no case."""

import json

import pandas as pd
import pytest
from made_blind_documents import oracle, silence, truth
from made_blind_facts import MANIFEST, MEASURED, PROOF, facts_of, tables
from scipy.stats import beta

from elastocal_proof.blind.confusion import CLASS_WITHOUT
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


def test_each_verdict_on_an_effect_outside_of_the_catalogue_has_its_own_share(given):
    row = given["confusion"].query("truth == 'outside:refraction'").iloc[0]
    counts = {
        CLASS_WITHOUT: 1,
        "several": 2,
        "unexplained": 4,
        "adequate": 2,
        "not_testable": 1,
        "payload": 6,
        "lost_motion": 4,
    }
    kept = ["robots", "settings", "truth", "level"]
    row = {name: row[name] if name in kept else counts.get(name, 0) for name in row.index}
    changed = given | {"confusion": pd.DataFrame([row])}
    (found,) = blind_facts(changed, "", "quick", 7)["outside"]
    # Names of the catalogue, class, several, unexplained and adequate or not testable, of 20 cases.
    assert found == ["refraction", "200", "20", "50", "5", "10", "20", "15"]


def test_what_is_absorbed_is_listed_with_its_reason(facts):
    (row,) = facts["undetectable"]
    assert row[0] == "force scale" and row[3] == "absorbed by the joint compliances" and row[4] == "0 of 1"


def test_follow_up_rows_are_worded(facts):
    assert facts["follow_up"] == [["proof", "proposed", "5", "12", "75 %", "43–95 %"]]


def test_near_relatives_are_worded_for_all_pairs_together(tmp_path):
    shares = [0.5, 0.2, 0.8, 0.25, 0.1, 0.4, 0.25, 0.1, 0.4, 0.0, 0.0, 0.2]
    rows = [("all", 20.0, 4, *shares), ("payload / link_weight", 20.0, 4, *shares)]
    found = facts_of(tmp_path, *PROOF, sweep=rows)["sweep"]
    assert found == [["20°", "4", "50 (20–80)", "25 (10–40)", "25 (10–40)", "0 (0–20)"]]


def test_cases_are_counted_by_group_and_robot_with_their_sum(facts):
    counts = facts["counts"]
    assert counts["heads"] == ["cases", "kuka", "m900ib700"]
    assert counts["rows"] == [
        ["no effect", "0", "3"],
        ["one effect of the catalogue", "1", "3"],
        ["one effect outside of the catalogue", "0", "1"],
        ["all", "1", "7"],
    ]


def test_the_protocol_names_what_was_sealed_before_the_analysis(facts):
    # sha256sum of the manifest's one line.
    digest = "3ae7965672b1e6c5db56e64bfa3e60e5110d2e1190a8e73418f9f5372eb1ee81"
    counted = {"cases": "8", "size": "quick", "seed": "7", "truths": "1"}
    assert facts["protocol"] == counted | {"digest": digest, "levels": "50", "outside": "refraction"}


def test_effects_have_their_shares_with_intervals_and_their_size(facts):
    rows = {row[0]: row for row in facts["effects"]}
    low, high = (100 * beta.ppf(share, *of) for share, of in ((0.025, (1, 2)), (0.975, (2, 1))))
    half = f"50 ({low:.0f}–{high:.0f})"
    assert rows["payload"] == ["payload", "50", "2", half, half, half, "100 (16–100)", "60.0 µm", "0.50"]
    # What is absorbed has no size beyond the joint compliances: it is that of the raw signal.
    assert rows["force scale"][1] == "50 raw"


def summary_rows(**values):
    row = {
        "robots": "proof",
        "hits": 3.0,
        "cases": 1234,
        "rate": 0.25,
        "low": 0.125,
        "high": 0.5,
        "target": None,
        "holds": None,
    }
    return pd.DataFrame([row | values])


@pytest.mark.parametrize(
    "values, worded",
    [
        ({"quantity": "detected at 50"}, ["3 of 1 234", "25.0 %", "12.5–50.0 %"]),
        (
            {"quantity": "detected at 50", "rate": None, "low": None, "high": None, "hits": 0.0, "cases": 0},
            ["0 of 0", "–", "–"],
        ),
        (
            {"quantity": "held-out RMS after, over the oracle's, mean", "hits": None, "rate": 1.02, "low": 1.01, "high": 1.033},
            ["1 234", "1.020", "1.010–1.033"],
        ),
    ],
    ids=["a share", "no case", "a ratio"],
)
def test_figures_without_a_target_are_worded_as_shares_or_ratios(given, values, worded):
    changed = given | {"summary": summary_rows(**values)}
    (row,) = blind_facts(changed, "", "quick", 7)["further"]["proof"]
    assert [cell.replace("\u2009", " ") for cell in row[1:]] == worded


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
