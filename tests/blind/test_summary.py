"""Every figure beside its target, over every case that belongs to it and no other; and the tables of the pictures."""

import numpy as np
import pandas as pd
import pytest
from made_blind_documents import PLAN, effect, frame, oracle, said, silence, summary, truth, verdict
from scipy.stats import beta

from elastocal_proof.blind.summary import calibration, calibration_error, follow_up_rates, followed, rates, swept

PAYLOAD = said("named", "payload")
ONE = truth(("payload",))


def test_rates_have_clopper_pearson_intervals_and_are_held_against_their_targets():
    entries = [(ONE, PAYLOAD, oracle())] * 7 + [(ONE, silence(), oracle())] * 3
    row = summary(*entries).loc[("proof", "detected at 50")]
    assert (row.hits, row.cases, row.rate, row.target, row.holds) == (7, 10, 0.7, "at least 98 %", False)
    assert row.low == pytest.approx(beta.ppf(0.025, 7, 4)) and row.high == pytest.approx(beta.ppf(0.975, 8, 3))
    assert summary(*entries[:7]).loc[("proof", "detected at 50")].holds
    # At other levels there is no target.
    other = summary((truth(("payload",), level=25.0), PAYLOAD, oracle())).loc[("proof", "detected at 25")]
    assert (other.target, other.holds) == ("", None)


def test_the_plan_has_a_target_for_each_of_the_figures_of_the_proof():
    groups = {"single": 25.0, "pair": 50.0, "outside": 200.0, "several_joints": 200.0, "gear_gravity": 200.0}
    entries = [(truth(("payload",), group=group, level=level), PAYLOAD, oracle()) for group, level in groups.items()]
    entries += [(truth(("payload",), level=level), PAYLOAD, oracle()) for level in (50.0, 200.0)]
    table = summary(*entries, (truth(), silence(), oracle(1.0)))
    assert (table.target != "").sum() == 27


def test_false_alarms_are_held_against_their_upper_limit_and_hard_settings_are_apart():
    hard = (truth(group="setting", setting="force_3kN"), PAYLOAD, oracle(1.0))
    few = summary(*[(truth(), silence(), oracle(1.0))] * 20, hard).loc["proof"]
    row = few.loc["false alarms with no effect"]
    assert (row.hits, row.cases, row.holds) == (0, 20, False)
    assert (few.loc["false alarms, 3 kN"].hits, few.loc["false alarms, twelve poses"].cases) == (1, 0)
    many = summary(*[(truth(), silence(), oracle(1.0))] * 100, hard)
    assert many.loc[("proof", "false alarms with no effect")].holds


def test_errors_are_held_against_the_oracle_where_something_was_detected():
    table = summary(
        (ONE, verdict("named", effect("payload"), after=1.0e-4), oracle(rms=1e-4)),
        (ONE, verdict("named", effect("payload"), after=1.2e-4), oracle(rms=1e-4)),
        (ONE, verdict("adequate", after=9e-4), oracle(rms=1e-4)),
        (truth(("outside:refraction",), group="outside"), PAYLOAD, None),
    ).loc["proof"]
    row = table.loc["held-out RMS after, over the oracle's, mean"]
    assert (row.cases, row.rate, row.holds) == (2, pytest.approx(1.1), False)
    assert row.low == pytest.approx(1.0) and row.high == pytest.approx(1.2)
    assert table.loc["held-out RMS after within 5 % of the oracle's"].hits == 1


def test_the_share_of_the_oracles_fall_counts_what_was_missed():
    found = (ONE, verdict("named", effect("payload"), before=2e-4, after=1e-4), oracle(rms=1e-4))
    missed = (ONE, verdict("adequate", before=2e-4, after=2e-4), oracle(rms=1e-4))
    row = summary(found, missed).loc[("proof", "share of the oracle's fall of the held-out mean square that is reached, at 50")]
    assert row.rate == pytest.approx(0.5)


def test_effects_that_make_held_out_errors_worse_count_against_all_that_were_adopted():
    worse = verdict("named", effect("payload"), before=1e-4, after=1.2e-4, reduction=(-0.22, -0.18), warnings=["held-out grew"])
    quantity = ("proof", "effect adopted and held-out RMS worse by over two standard errors")
    fine = [(ONE, PAYLOAD, oracle())] * 98
    # What was found and not adopted is neither.
    unsure = verdict("class", effect("payload", adopted=False), before=1e-4, after=1.2e-4, reduction=(-0.22, -0.18))
    silent = [(truth(), silence(), oracle(1.0))] * 50 + [(ONE, unsure, oracle())] * 5
    row = summary(*fine, *silent).loc[quantity]
    assert (row.hits, row.cases, row.holds) == (0, 98, True)
    assert not summary(*fine, *silent, *[(ONE, worse, oracle())] * 2).loc[quantity].holds


@pytest.mark.parametrize(("right", "holds"), [(36, True), (35, True), (34, False), (20, False)])
def test_pairs_are_held_against_what_the_best_analyst_finds_of_the_same_cases(right, holds):
    """34 of 36 are 94.4 %; cases for which the limit was not worked out take no part."""
    pair = truth(("payload",), ("joint_tilt", 2), group="pair", level=200.0)
    both = verdict("several", effect("payload"), effect("joint_tilt", 2))
    found = [both] * right + [PAYLOAD] * (40 - right)
    best = [{"detected": True, "right": number < 36} for number in range(40)]
    sampled = [(pair, one, oracle(), limit) for one, limit in zip(found, best, strict=True)]
    table = summary(*sampled, *[(pair, PAYLOAD, oracle())] * 50).loc["proof"]
    row = table.loc["both of two effects at 200 each, over the best analyst's, on the same cases"]
    assert row.cases == 40 and row.rate == pytest.approx(right / 36) and row.holds == holds
    assert row.low < row.rate < row.high or right == 36
    assert table.loc["both of two effects at 200 each, by the best analyst"].hits == 36


def test_stated_probabilities_are_held_against_how_often_they_are_so():
    sets = [{"mechanisms": ["payload"], "probability": 1.0}]
    sure = PAYLOAD | {"probabilities": {"sets": sets, "nothing": 0.0, "alarm_p_value": 0.001}}
    entries = [(ONE, sure, oracle())] * 98 + [(truth(("joint_tilt", 2)), sure, oracle())] * 2
    table = summary(*entries, (ONE, silence(), oracle())).loc["proof"]
    row = table.loc["stated probability of the most probable mechanisms: expected calibration error"]
    assert (row.cases, row.rate, row.holds) == (100, pytest.approx(0.02), True)
    row = table.loc["95 % sets of hypotheses that hold the truth"]
    assert (row.hits, row.cases, row.holds) == (98, 100, True)


def test_the_error_is_the_mean_distance_in_bins_weighted_by_their_cases():
    probability = np.array([0.95] * 10 + [0.55] * 5)
    correct = np.array([True] * 9 + [False] + [True] * 4 + [False])
    assert calibration_error(probability, correct) == pytest.approx((10 * 0.05 + 5 * 0.25) / 15)
    # A certain statement belongs to the last bin.
    assert calibration_error(np.ones(4), np.array([True] * 4)) == 0.0


def test_calibrated_statements_have_the_error_of_chance_and_overconfident_ones_more():
    """Of 2,000 cases: by chance about 1.5 %; statements whose odds are squared are off by over 8 %, five times as much."""
    rng = np.random.default_rng(5)
    probability = rng.uniform(0.3, 1.0, 2000)
    correct = rng.random(2000) < probability
    found = calibration(pd.DataFrame({"stated": probability, "correct": correct}), 1)
    assert 0.005 < found["by_chance"]["rate"] < 0.025
    assert found["calibration_error"]["rate"] < 2 * found["by_chance"]["rate"]
    bold = probability**2 / (probability**2 + (1 - probability) ** 2)
    assert calibration_error(bold, correct) > 0.08


@pytest.mark.slow
def test_the_interval_of_the_error_holds_a_miscalibration_that_is_known():
    """Stated 0.9 and true in 0.8: an error of 0.1, which 100 samples of 400 cases hold in at least 88; the power to see a
    nominal 80 % interval instead is over 95 %."""
    rng, held = np.random.default_rng(6), 0
    for seed in range(100):
        rows = pd.DataFrame({"stated": 0.9, "correct": rng.random(400) < 0.8})
        found = calibration(rows, seed)["calibration_error"]
        held += found["low"] <= 0.1 <= found["high"]
    assert held >= 88


def test_a_truth_has_a_row_for_each_level_beside_the_oracle_and_what_is_absorbed_is_not_among_all():
    scale = truth(("force_scale",))
    scale["defects"][0] |= {"of": "raw", "signal": {"raw": 50.0, "retained": 5e-5, "rms_m": 6e-5, "rms_rad": 6e-5}}
    high = truth(("payload",), level=200.0)
    table = rates(
        frame(
            (ONE, PAYLOAD, oracle()), (ONE, silence(), oracle(0.2)), (high, PAYLOAD, oracle()), (scale, silence(), oracle(1.0))
        )
    ).set_index(["truth", "level"])
    row = table.loc[("payload", 50.0)]
    assert (row.cases, row.detected, row.named_right, row.oracle_detected) == (2, 0.5, 0.5, 0.5)
    assert 0 < row.detected_low < 0.5 < row.detected_high < 1 and row.signal_rms_m == pytest.approx(6e-5)
    assert table.loc[("all", 50.0), "cases"] == 2 and table.loc[("all", 200.0), "detected"] == 1.0
    assert table.loc[("force_scale", 50.0), "retained_share"] == pytest.approx(1e-3)


def test_each_case_of_the_sweep_counts_in_the_bin_of_its_angle():
    verdicts = [said("class", "link_weight", alternatives=["payload"]), said("named", "link_weight"), PAYLOAD, said("adequate")]
    truths = {
        name: truth(("payload",), group="sweep", campaign=name, alternative={"effect": "link_weight", "angle_deg": angle})
        for name, angle in zip("abcd", (3.0, 4.9, 5.1, 90.0), strict=True)
    }
    entries = [(document, found, None) for document, found in zip(truths.values(), verdicts, strict=True)]
    table = swept(frame(*entries, (ONE, PAYLOAD, None)), truths)
    assert table["cases"].groupby(table["pair"]).sum().to_dict() == {"all": 4, "link_weight / payload": 4}
    row = table[(table["pair"] == "all") & (table["angle_up_to_deg"] == 5)].iloc[0]
    assert (row["cases"], row["right"], row["class"], row["wrong"], row["other"]) == (2, 0, 0.5, 0.5, 0)
    assert row["right_high"] == pytest.approx(beta.ppf(0.975, 1, 2)) and set(table["angle_up_to_deg"]) == {5, 10, 90}


def test_after_further_poses_every_case_counts_at_every_number_of_poses_and_a_single_name_stands():
    still, right = said("class", "link_weight", alternatives=["payload@2"]), PAYLOAD
    pair = truth(("payload",), ("joint_tilt", 2), group="pair", campaign="d")
    truths = {name: truth(("payload",), campaign=name) for name in "ab"} | {"d": pair}
    truths["c"] = truth(("payload",), campaign="c", robot="kuka")
    later = {
        ("a", "proposed"): [right],
        ("a", "random"): [still, still, still],
        ("b", "proposed"): [still, said("named", "link_weight")],
        ("b", "random"): [said("several", "payload", "joint_tilt"), still, right],
    }
    later |= {(case, arm): [right] for case in "cd" for arm in ("proposed", "random")}
    anew = [
        {"campaign": case, "arm": arm, "poses": poses, "verdict": found}
        for (case, arm), verdicts in later.items()
        for poses, found in zip((5, 10, 20), verdicts, strict=False)
    ]
    proposals = pd.DataFrame(
        {"case": [*"abcd"], "separation": [2.0, 30.0, 40.0, 100.0], "indistinguishable": ["", "", "x", ""]}
    )
    cases = followed(PLAN, truths, dict.fromkeys("abcd", still), anew, proposals)
    assert len(cases) == 4 * 2 * 4
    table = follow_up_rates(cases).set_index(["robots", "of", "arm", "poses_added"])
    before = table.loc[("proof", "one effect", "proposed", 0)]
    assert (before["cases"], before["right_name"], before["still_class"], before["wrong_name"]) == (2, 0, 2, 0)
    assert (before["low"], before["high"]) == (0, pytest.approx(beta.ppf(0.975, 1, 2)))
    for poses, share, classes, wrong in ((5, 0.5, 1, 0), (10, 0.5, 0, 1), (20, 0.5, 0, 1)):
        found = table.loc[("proof", "one effect", "proposed", poses)]
        assert (found["right_name"], found["still_class"], found["wrong_name"]) == (share, classes, wrong)
    assert table.loc[("proof", "one effect", "random", 5), "other_verdict"] == 1
    # Case b alone promises enough; c leaves an alternative aside.
    assert (
        table.loc[("proof", "promising", "random", 20), "cases"] == 1
        and ("tuned", "promising", "random", 20) not in table.index
    )
    assert table.loc[("proof", "other", "random", 20), "cases"] == 1
