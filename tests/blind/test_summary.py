"""Every figure beside its target, over every case that belongs to it and no other; and
the tables of the pictures."""

import pytest
from made_blind_documents import effect, oracle, said, silence, summary, truth, verdict
from scipy.stats import beta

PAYLOAD = said("named", "payload")
ONE = truth(("payload",))


def test_rates_have_clopper_pearson_intervals_and_are_held_against_their_targets():
    entries = [(ONE, PAYLOAD, oracle())] * 7 + [(ONE, silence(), oracle())] * 3
    row = summary(*entries).loc[("proof", "detected at 50")]
    assert (row.hits, row.cases, row.rate, row.target, row.holds) == (
        7,
        10,
        0.7,
        "at least 98 %",
        False,
    )
    assert row.low == pytest.approx(
        beta.ppf(0.025, 7, 4)
    ) and row.high == pytest.approx(beta.ppf(0.975, 8, 3))
    assert summary(*entries[:7]).loc[("proof", "detected at 50")].holds
    # At other levels there is no target.
    other = summary((truth(("payload",), level=25.0), PAYLOAD, oracle())).loc[
        ("proof", "detected at 25")
    ]
    assert (other.target, other.holds) == ("", None)


def test_the_plan_has_a_target_for_each_of_the_figures_of_the_proof():
    groups = {
        "single": 25.0,
        "pair": 50.0,
        "outside": 200.0,
        "several_joints": 200.0,
        "gear_gravity": 200.0,
    }
    entries = [
        (truth(("payload",), group=group, level=level), PAYLOAD, oracle())
        for group, level in groups.items()
    ]
    entries += [
        (truth(("payload",), group=group, level=200.0), PAYLOAD, oracle())
        for group in ("single", "pair")
    ]
    entries += [(truth(("payload",), level=50.0), PAYLOAD, oracle())]
    table = summary(*entries, (truth(), silence(), oracle(1.0)))
    assert (table.target != "").sum() == 32


def test_false_alarms_are_held_against_their_upper_limit_and_hard_settings_are_apart():
    hard = (truth(group="setting", setting="force_3kN"), PAYLOAD, oracle(1.0))
    few = summary(*[(truth(), silence(), oracle(1.0))] * 20, hard).loc["proof"]
    row = few.loc["false alarms with no effect"]
    assert (row.hits, row.cases, row.holds) == (0, 20, False)
    assert (
        few.loc["false alarms, 3 kN"].hits,
        few.loc["false alarms, twelve poses"].cases,
    ) == (1, 0)
    many = summary(*[(truth(), silence(), oracle(1.0))] * 100, hard)
    assert many.loc[("proof", "false alarms with no effect")].holds


@pytest.mark.parametrize(
    ("right", "holds"), [(36, True), (35, True), (34, False), (20, False)]
)
def test_pairs_are_held_against_what_the_best_analyst_finds_of_the_same_cases(
    right, holds
):
    """34 of 36 are 94.4 %; cases for which the limit was not worked out take no
    part."""
    pair = truth(("payload",), ("joint_tilt", 2), group="pair", level=200.0)
    both = verdict("several", effect("payload"), effect("joint_tilt", 2))
    found = [both] * right + [PAYLOAD] * (40 - right)
    best = [{"detected": True, "right": number < 36} for number in range(40)]
    sampled = [
        (pair, one, oracle(), limit) for one, limit in zip(found, best, strict=True)
    ]
    table = summary(*sampled, *[(pair, PAYLOAD, oracle())] * 50).loc["proof"]
    row = table.loc[
        "both of two effects at 200 each, over the best analyst's, on the same cases"
    ]
    assert (
        row.cases == 40 and row.rate == pytest.approx(right / 36) and row.holds == holds
    )
    assert row.low < row.rate < row.high or right == 36
    assert table.loc["both of two effects at 200 each, by the best analyst"].hits == 36


def test_that_something_remains_is_held_against_where_it_does_and_where_nothing_does():
    remaining = {"repeatable": {"remains": True}}
    left = truth(("outside:two_angles", 3), group="remains", level=1e4)
    entries = [(left, PAYLOAD | remaining, None)] * 19 + [
        (left, PAYLOAD, None),
        (truth(), silence() | remaining, oracle(1.0)),
    ]
    table = summary(
        *entries,
        *[(truth(group="setting", setting="force_3kN"), silence(), oracle(1.0))] * 30,
    ).loc["proof"]
    said, falsely = (
        table.loc[f"said to remain, where {words}"]
        for words in ("something repeatable does", "nothing does, all settings")
    )
    assert (said.hits, said.cases, said.holds) == (19, 20, True)
    assert (falsely.hits, falsely.cases, falsely.holds) == (1, 31, False)
