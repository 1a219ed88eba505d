"""Rates of verdicts that stay the same and of rows that are named, from slips with known answers."""

import numpy as np
import pytest
from made_proofs import made_slips
from scipy.stats import binomtest

from elastocal_proof.blind.bad_rows_summary import SAME, judge_cases, summarize


@pytest.fixture
def slips():
    return judge_cases({"kuka": made_slips(), "abb": made_slips(seed=5)})


def figure(table, quantity, of):
    (row,) = table[(table["quantity"] == quantity) & (table["of"] == of)].to_dict("records")
    return row


def test_a_case_counts_once_however_many_slips_it_has(slips):
    cases = slips.drop_duplicates(["robot", "seed"])
    row = figure(summarize(slips), SAME, "all cases")
    assert row["cases"] == len(cases) == 80 < len(slips)
    assert row["hits"] == (cases["damaged_verdict"] == "adequate").sum() < 80
    interval = binomtest(int(row["hits"]), 80).proportion_ci(0.95, "exact")
    np.testing.assert_allclose([row["low"], row["high"]], [interval.low, interval.high], rtol=1e-8)
    assert row["target"] == 0.97 and row["holds"] == (row["rate"] >= 0.97)


def test_a_verdict_is_the_same_where_word_and_mechanisms_are_and_stricter_with_joints(slips):
    one = slips.iloc[:1].drop(columns=[name for name in slips if "_same" in name or name == "heldout_ratio"])
    said = {"damaged_verdict": one["clean_verdict"].iloc[0], "damaged_found": one["clean_found"].iloc[0]}
    one = one.assign(**said, damaged_found_at="payload 2")
    found = judge_cases({"kuka": one.drop(columns="robot")}).iloc[0]
    assert found["damaged_same"] and not found["damaged_same_joints"]
    other = judge_cases({"kuka": one.assign(damaged_verdict="class").drop(columns="robot")}).iloc[0]
    assert not other["damaged_same"]
