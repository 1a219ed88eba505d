"""Every figure beside its target, over every case that belongs to it and no other."""

import re

import pandas as pd
import pytest
from made_blind_documents import effect, frame, oracle, silence, truth, verdict
from scipy.stats import beta

from elastocal_proof.blind.calibration import statements
from elastocal_proof.blind.cases import HARD, SETTINGS
from elastocal_proof.blind.coverage import intervals_of
from elastocal_proof.blind.limit import COMPARED
from elastocal_proof.blind.targets import (
    BY_THE_BEST,
    OF_ALL_CASES,
    OVER_THE_BEST,
    by_setting,
    of_each_robot,
    setting_words,
    summarized,
    worded,
)

PAYLOAD = verdict("named", effect("payload"))


def summary(*entries):
    intervals = pd.DataFrame([row for document, said, *_ in entries for row in intervals_of(document, said)])
    said = statements((document, verdict) for document, verdict, *_ in entries)
    return summarized(frame(*entries), intervals, said, 1).set_index(["robots", "quantity"])


def test_rates_have_clopper_pearson_intervals_and_are_held_against_their_targets():
    entries = [(truth(("payload",)), PAYLOAD, oracle())] * 7 + [(truth(("payload",)), silence(), oracle())] * 3
    row = summary(*entries).loc[("proof", "detected at 50")]
    assert (row.hits, row.cases, row.rate, row.target, row.holds) == (7, 10, 0.7, "at least 98 %", False)
    assert row.low == pytest.approx(beta.ppf(0.025, 7, 4)) and row.high == pytest.approx(beta.ppf(0.975, 8, 3))
    assert summary(*entries[:7]).loc[("proof", "detected at 50")].holds


def test_false_alarms_are_held_against_their_upper_limit_and_leave_hard_settings_out():
    hard = (truth(group="setting", setting="outliers_5_percent"), PAYLOAD, oracle(1.0))
    few = summary(*[(truth(), silence(), oracle(1.0))] * 20, hard)
    row = few.loc[("proof", "false alarms with no effect")]
    assert (row.hits, row.cases, row.holds) == (0, 20, False)
    many = summary(*[(truth(), silence(), oracle(1.0))] * 100, hard)
    assert many.loc[("proof", "false alarms with no effect")].holds


def test_the_robot_of_tuning_is_shown_apart():
    table = summary((truth(("payload",)), PAYLOAD, oracle()), (truth(("payload",), robot="kuka"), silence(), oracle()))
    assert table.loc[("proof", "detected at 50")].hits == 1
    assert table.loc[("tuned", "detected at 50")].hits == 0


def test_aliases_are_aside_for_the_single_name_only():
    alias = truth(("transmission_harmonic", 2), level=200.0)
    confused = verdict("class", effect("compensator_torque", 2, alternatives=["transmission_harmonic@2[orders 1-2]"]))
    right = (truth(("payload",), level=200.0), PAYLOAD, oracle())
    table = summary((alias, confused, oracle()), right).loc["proof"]
    assert table.loc["right name alone, exact aliases aside, at 200"].cases == 1
    assert table.loc["right name, or class with it, given detection, at 200"].cases == 2
    assert table.loc["right name, or class with it, of exact aliases, at 200"].hits == 1


def test_what_is_absorbed_is_a_row_of_its_own():
    scale = truth(("force_scale",))
    scale["defects"][0]["of"] = "raw"
    table = summary((scale, silence(), oracle(1.0)), (truth(("payload",)), PAYLOAD, oracle())).loc["proof"]
    assert table.loc["detected at 50"].cases == 1
    assert table.loc["detected though wholly absorbed (force scale)"].cases == 1


def test_errors_are_held_against_the_oracle_where_something_was_detected():
    table = summary(
        (truth(("payload",)), verdict("named", effect("payload"), after=1.0e-4), oracle(rms=1e-4)),
        (truth(("payload",)), verdict("named", effect("payload"), after=1.2e-4), oracle(rms=1e-4)),
        (truth(("payload",)), verdict("adequate", after=9e-4), oracle(rms=1e-4)),
        (truth(("outside:refraction",), group="outside"), PAYLOAD, None),
    ).loc["proof"]
    row = table.loc["held-out RMS after, over the oracle's, mean"]
    assert (row.cases, row.rate, row.holds) == (2, pytest.approx(1.1), False)
    assert row.low == pytest.approx(1.0) and row.high == pytest.approx(1.2)
    assert table.loc["held-out RMS after within 5 % of the oracle's"].hits == 1


def test_the_share_of_the_oracles_fall_counts_what_was_missed():
    found = (truth(("payload",)), verdict("named", effect("payload"), before=2e-4, after=1e-4), oracle(rms=1e-4))
    missed = (truth(("payload",)), verdict("adequate", before=2e-4, after=2e-4), oracle(rms=1e-4))
    row = summary(found, missed).loc[("proof", "share of the oracle's fall of the held-out mean square that is reached, at 50")]
    assert row.rate == pytest.approx(0.5)


def test_effects_that_make_held_out_errors_worse_count_against_all_that_were_adopted_warned_of_or_not():
    worse = verdict("named", effect("payload"), before=1e-4, after=1.2e-4, reduction=(-0.22, -0.18), warnings=["held-out grew"])
    quantity = "effect adopted and held-out RMS worse by over two standard errors"
    fine = [(truth(("payload",)), PAYLOAD, oracle())] * 98
    # What was found and not adopted is neither.
    unsure = verdict("class", effect("payload", adopted=False), before=1e-4, after=1.2e-4, reduction=(-0.22, -0.18))
    silent = [(truth(), silence(), oracle(1.0))] * 50 + [(truth(("payload",)), unsure, oracle())] * 5
    row = summary(*fine, *silent).loc[("proof", quantity)]
    assert (row.hits, row.cases, row.holds) == (0, 98, True)
    assert not summary(*fine, *silent, *[(truth(("payload",)), worse, oracle())] * 2).loc[("proof", quantity)].holds


def test_each_hard_setting_has_its_false_alarms_and_its_own_target():
    pulled, other = (truth(group="setting", setting=setting) for setting in ("force_3kN", "on_a_wall"))
    alarms = [(pulled, PAYLOAD, oracle(1.0))] * 2
    table = summary(*alarms, *[(pulled, silence(), oracle(1.0))] * 18, (other, PAYLOAD, oracle(1.0)))
    row = table.loc[("proof", "false alarms, force 3kN")]
    assert (row.hits, row.cases, row.target, row.holds) == (2, 20, "at most 6 %", False)
    assert table.loc[("proof", "false alarms, off line centres")].cases == 0


@pytest.mark.parametrize(("right", "holds"), [(36, True), (35, True), (34, False), (20, False)])
def test_pairs_are_held_against_what_the_best_analyst_finds_of_the_same_cases(right, holds):
    """34 of 36 are 94.4 %; cases for which the limit was not worked out take no part."""
    pair = truth(("payload",), ("joint_tilt", 2), group="pair", level=200.0)
    both, one = verdict("several", effect("payload"), effect("joint_tilt", 2)), PAYLOAD
    found = [both] * right + [one] * (40 - right)
    best = [{"detected": True, "right": number < 36} for number in range(40)]
    sampled = [(pair, said, oracle(), limit) for said, limit in zip(found, best, strict=True)]
    table = summary(*sampled, *[(pair, one, oracle())] * 50).loc["proof"]
    row = table.loc["both of two effects at 200 each, over the best analyst's, on the same cases"]
    assert row.cases == 40 and row.rate == pytest.approx(right / 36) and row.holds == holds
    assert row.low < row.rate < row.high or right == 36
    assert table.loc["both of two effects at 200 each, by the best analyst"].hits == 36


@pytest.mark.parametrize(
    ("group", "quantity", "share"),
    [
        ("several_joints", "one mechanism at several joints: that one alone, at 200", "at least 95 %"),
        ("gear_gravity", "gear defect under declared gravity: right name alone, at 200", "at least 90 %"),
    ],
)
def test_new_groups_count_the_single_right_name(group, quantity, share):
    document = truth(("joint_offset", 2), ("joint_offset", 3), ("joint_offset", 5), group=group, level=200.0)
    document["case"] |= {"effects": ["joint_offset"], "levels": [200.0]}
    right = verdict("named", effect("joint_offset", 2, 3, 5))
    beside = verdict("several", effect("joint_offset", 2, 3), effect("link_geometry", 5))
    row = summary(*[(document, right, oracle())] * 9, (document, beside, oracle())).loc[("proof", quantity)]
    assert (row.hits, row.cases, row.target) == (9, 10, share)


def test_stated_probabilities_are_held_against_how_often_they_are_so():
    sure = PAYLOAD | {
        "probabilities": {"sets": [{"mechanisms": ["payload"], "probability": 1.0}], "nothing": 0.0, "alarm_p_value": 0.001}
    }
    entries = [(truth(("payload",)), sure, oracle())] * 98 + [(truth(("joint_tilt", 2)), sure, oracle())] * 2
    table = summary(*entries).loc["proof"]
    row = table.loc["stated probability of the most probable mechanisms: expected calibration error"]
    assert (row.cases, row.rate, row.holds) == (100, pytest.approx(0.02), True)
    row = table.loc["95 % sets of hypotheses that hold the truth"]
    assert (row.hits, row.holds) == (98, True)
    none = summary(*[(truth(), silence(), oracle(1.0))]).loc["proof"]
    assert none.loc["95 % sets of hypotheses that hold the truth"].cases == 0


def test_settings_tell_false_alarms_effects_and_hidden_effects_apart():
    design = {"covariates": []}
    hidden = truth(("hysteresis", 1), group="setting", setting="without_covariates", level=200.0, design=design)
    null = truth(group="setting", setting="outliers_5_percent")
    table = by_setting(
        frame(
            (hidden, silence(), oracle(1.0)),
            (null, PAYLOAD, oracle(1.0)),
            (truth(("payload",), group="setting", setting="outliers_5_percent"), PAYLOAD, oracle()),
            (truth(("payload",)), PAYLOAD, oracle()),
        )
    ).set_index(["setting", "kind"])
    assert table.cases.to_dict() == {
        ("outliers_5_percent", "effect"): 1,
        ("outliers_5_percent", "no effect"): 1,
        ("without_covariates", "hidden effect"): 1,
    }
    assert table.loc[("outliers_5_percent", "no effect"), "wrong"] == 1


def test_no_setting_is_shown_by_a_name_of_the_configuration():
    assert [name for name in SETTINGS if re.search(r"_|\d[a-zA-Z]|percent", setting_words(name))] == []
    shown = worded(summary((truth(), silence(), oracle(1.0))).reset_index()).quantity
    alarms = [quantity for quantity in shown if quantity.startswith("false alarms, ")]
    assert alarms == [f"false alarms, {setting_words(name)}" for name in HARD] and "false alarms, 3 kN" in alarms


def test_what_a_limit_is_compared_with_has_a_figure_of_all_cases():
    entries = [
        (truth(*(("payload",), ("joint_tilt", 2))[: 1 + (group == "pair")], group=group, level=level), silence(), oracle())
        for group, level in COMPARED
    ]
    named = summary(*entries).loc["proof"].index
    for _, _, words in COMPARED.values():
        assert {OF_ALL_CASES.get(words, words), words + BY_THE_BEST, words + OVER_THE_BEST} <= set(named)


def test_each_robot_of_the_proof_has_its_own_figures():
    entries = [
        (truth(("payload",)), PAYLOAD, oracle()),
        (truth(("payload",), robot="panda"), silence(), oracle()),
        (truth(("payload",), robot="kuka"), silence(), oracle()),
    ]
    alone = of_each_robot(frame(*entries), statements((document, found) for document, found, _ in entries), 1)
    rates = {name: table.set_index("quantity").rate["detected at 50"] for name, table in alone.items()}
    assert rates == {"m900ib700": 1.0, "panda": 0.0}
