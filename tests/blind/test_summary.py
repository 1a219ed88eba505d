"""Figures of the blind benchmark: each counts the cases that belong to it and no
others, and is compared with its target."""

import pytest
from made_blind_documents import (
    make_adequate_verdict,
    make_effect,
    make_oracle,
    make_plain_verdict,
    make_truth,
    make_verdict,
    summarize_entries,
)
from scipy.stats import beta

PAYLOAD = make_plain_verdict("named", "payload")
PAYLOAD_TRUTH = make_truth(("payload",))
DETECTED = (PAYLOAD_TRUTH, PAYLOAD, make_oracle())
MISSED = (PAYLOAD_TRUTH, make_adequate_verdict(), make_oracle())
# A case without an effect, and a verdict without one.
SILENT = (make_truth(), make_adequate_verdict(), make_oracle(1.0))


def test_a_rate_has_a_clopper_pearson_interval_and_is_compared_with_its_target():
    summary = summarize_entries(*[DETECTED] * 7, *[MISSED] * 3)
    row = summary.loc[("proof", "detected at 50")]
    assert (row.hits, row.cases, row.rate) == (7, 10, 0.7)
    assert row.target == "at least 98 %"
    assert row.holds is False
    assert row.low == pytest.approx(beta.ppf(0.025, 7, 4))
    assert row.high == pytest.approx(beta.ppf(0.975, 8, 3))
    without_misses = summarize_entries(*[DETECTED] * 7)
    assert without_misses.loc[("proof", "detected at 50")].holds


def test_a_level_that_the_plan_does_not_judge_has_no_target():
    truth = make_truth(("payload",), level=25.0)
    summary = summarize_entries((truth, PAYLOAD, make_oracle()))
    row = summary.loc[("proof", "detected at 25")]
    assert row.target == ""
    assert row.holds is None


def test_the_plan_has_a_target_for_each_figure_of_the_benchmark():
    levels = [
        ("single", 25.0),
        ("single", 50.0),
        ("single", 200.0),
        ("pair", 50.0),
        ("pair", 200.0),
        ("outside", 200.0),
        ("several_joints", 200.0),
        ("gear_gravity", 200.0),
    ]
    entries = [
        (make_truth(("payload",), group=group, level=level), PAYLOAD, make_oracle())
        for group, level in levels
    ]
    summary = summarize_entries(*entries, SILENT)
    assert (summary.target != "").sum() == 32


def test_false_alarms_need_a_low_upper_limit_and_hard_settings_are_counted_apart():
    hard_truth = make_truth(group="setting", setting="force_3kN")
    hard = (hard_truth, PAYLOAD, make_oracle(1.0))
    of_few_cases = summarize_entries(*[SILENT] * 20, hard).loc["proof"]
    row = of_few_cases.loc["false alarms with no effect"]
    assert (row.hits, row.cases) == (0, 20)
    assert row.holds is False
    assert of_few_cases.loc["false alarms, 3 kN"].hits == 1
    assert of_few_cases.loc["false alarms, twelve poses"].cases == 0
    of_many_cases = summarize_entries(*[SILENT] * 100, hard)
    assert of_many_cases.loc[("proof", "false alarms with no effect")].holds


@pytest.mark.parametrize(
    ("right", "holds"), [(36, True), (35, True), (34, False), (20, False)]
)
def test_pairs_are_compared_with_the_best_analyst_on_the_same_cases(right, holds):
    """34 of 36 are 94.4 %; cases without a best analyst are not counted."""
    truth = make_truth(("payload",), ("joint_tilt", 2), group="pair", level=200.0)
    both = make_verdict("several", make_effect("payload"), make_effect("joint_tilt", 2))
    verdicts = [both] * right + [PAYLOAD] * (40 - right)
    sampled = [
        (truth, verdict, make_oracle(), {"detected": True, "right": number < 36})
        for number, verdict in enumerate(verdicts)
    ]
    not_sampled = [(truth, PAYLOAD, make_oracle())] * 50
    table = summarize_entries(*sampled, *not_sampled).loc["proof"]
    quantity = "both of two effects at 200 each"
    ratio = table.loc[f"{quantity}, over the best analyst's, on the same cases"]
    assert ratio.cases == 40
    assert ratio.rate == pytest.approx(right / 36)
    assert ratio.holds == holds
    assert ratio.low < ratio.rate < ratio.high or right == 36
    assert table.loc[f"{quantity}, by the best analyst"].hits == 36


def test_a_reported_residual_is_counted_where_there_is_one_and_where_there_is_none():
    reported = {"repeatable": {"remains": True}}
    remaining = make_truth(("outside:two_angles", 3), group="remains", level=1e4)
    hard = make_truth(group="setting", setting="force_3kN")
    table = summarize_entries(
        *[(remaining, PAYLOAD | reported, None)] * 19,
        (remaining, PAYLOAD, None),
        (make_truth(), make_adequate_verdict() | reported, make_oracle(1.0)),
        *[(hard, make_adequate_verdict(), make_oracle(1.0))] * 30,
    ).loc["proof"]
    hits = table.loc["said to remain, where something repeatable does"]
    assert (hits.hits, hits.cases) == (19, 20)
    assert hits.holds
    false_alarms = table.loc["said to remain, where nothing does, all settings"]
    assert (false_alarms.hits, false_alarms.cases) == (1, 31)
    assert false_alarms.holds is False
