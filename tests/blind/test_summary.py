"""Figures of the blind benchmark: each counts the cases that belong to it and no
others, and is compared with its target."""

import numpy as np
import pandas as pd
import pytest
from made_blind_documents import (
    make_adequate_verdict,
    make_effect,
    make_oracle,
    make_plain_verdict,
    make_truth,
    make_verdict,
    summarize_entries,
    tabulate_cases,
)
from scipy.stats import beta, binom

from elastocal_proof.blind.summary import (
    find_largest_bin_error,
    simulate_calibrated,
    simulate_largest_bin_error,
    tabulate_mechanisms,
)

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
    assert row.target == "at least 95 %"
    assert row.holds is False
    # All cases have one effect, so they are one cluster.
    assert row.low == pytest.approx(beta.ppf(0.025, 0.7, 1.3))
    assert row.high == pytest.approx(beta.ppf(0.975, 1.7, 0.3))
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
    # The target of the locations needs their table.
    assert (summary.target != "").sum() == 21


def test_false_alarms_of_hard_settings_are_counted_together_and_one_by_one():
    hard = [
        (make_truth(group="setting", setting=setting), verdict, make_oracle(1.0))
        for setting, verdict in (
            ("force_3kN", PAYLOAD),
            ("reflectors_off", make_adequate_verdict()),
        )
    ]
    table = summarize_entries(*[SILENT] * 24, *[make_alarm()] * 1, *hard).loc["proof"]
    row = table.loc["false alarms with no effect"]
    assert (row.hits, row.cases, row.holds) == (1, 25, True)
    assert row.power == pytest.approx(binom.cdf(1, 25, 0.025))
    assert row.risk == pytest.approx(binom.cdf(1, 25, 0.065))
    together = table.loc["false alarms, all hard settings together"]
    assert (together.hits, together.cases, together.holds) == (1, 2, False)
    assert table.loc["false alarms, 3 kN"].hits == 1
    assert table.loc["false alarms, reflectors 0.3 mm off"].cases == 1
    assert table.loc["false alarms, twelve poses"].cases == 0


def make_alarm():
    return (make_truth(), PAYLOAD, make_oracle(1.0))


def test_the_reduction_of_the_mean_square_is_compared_with_the_oracles():
    truth = make_truth(("payload",), level=200.0)
    verdict = make_verdict("named", make_effect("payload"), before=2e-4, after=1.2e-4)
    table = summarize_entries(*[(truth, verdict, make_oracle(rms=1e-4))] * 5)
    row = table.loc[
        ("proof", "share of the oracle's reduction of the held-out mean square, at 200")
    ]
    assert row.rate == pytest.approx((4.0 - 1.44) / (4.0 - 1.0))
    assert row.holds is False


def test_calibrated_statements_have_a_calibration_error_by_chance():
    rows = pd.DataFrame({"stated": [0.75] * 40})
    by_chance = simulate_calibrated(rows, 1)["rate"]
    # Mean absolute deviation of a binomial share about its mean.
    shares = np.arange(41) / 40
    expected = binom.pmf(np.arange(41), 40, 0.75) @ np.abs(shares - 0.75)
    assert by_chance == pytest.approx(expected, rel=0.05)


def test_the_largest_bin_error_is_that_of_the_worst_bin_with_cases_enough():
    probability = np.repeat([0.25, 0.55, 0.95], [20, 40, 60])
    correct = np.zeros(120, bool)
    # All of the first bin are wrong, 18 of 40 and 54 of 60 of the others are correct.
    correct[20:38] = True
    correct[60:114] = True
    rows = pd.DataFrame({"stated": probability, "correct": correct})
    assert find_largest_bin_error(rows)["rate"] == pytest.approx(0.55 - 18 / 40)
    assert np.isnan(find_largest_bin_error(rows[:20])["rate"])


def test_calibrated_statements_have_a_largest_bin_error_by_chance():
    rows = pd.DataFrame({"stated": [0.75] * 40})
    by_chance = simulate_largest_bin_error(rows, 1)
    deviations = np.abs(np.arange(41) / 40 - 0.75)
    probability = binom.pmf(np.arange(41), 40, 0.75)
    assert probability[deviations < by_chance["rate"]].sum() < 0.5
    assert probability[deviations <= by_chance["high"] + 1e-9].sum() >= 0.95


def test_mechanisms_are_counted_by_what_is_stated():
    other = make_plain_verdict("class", "link_weight", alternatives=["joint_tilt@2"])
    cases = tabulate_cases(*[DETECTED] * 2, MISSED, (PAYLOAD_TRUTH, other, None))
    table = tabulate_mechanisms(cases).set_index("stated")
    assert table.cases.to_dict() == {"adequate": 1, "link_weight": 1, "payload": 2}
    assert table.alone.to_dict() == {
        "adequate": False,
        "link_weight": False,
        "payload": True,
    }


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
    hits = table.loc["remaining repeatable error reported, cases that have one"]
    assert (hits.hits, hits.cases) == (19, 20)
    assert hits.holds
    false_alarms = table.loc[
        "remaining repeatable error reported, cases without one, all settings"
    ]
    assert (false_alarms.hits, false_alarms.cases) == (1, 31)
    assert false_alarms.holds is False
