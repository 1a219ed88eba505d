"""The name after further poses: every case counts at every number of poses, and a single name stands."""

import pytest
from made_verdicts import truth, verdict_of
from scipy.stats import beta

from elastocal_proof.blind.follow_up_scores import (
    followed,
    promises_kept,
    rates,
    with_one_effect,
)


def entry(case, arm, poses, verdict):
    return {"campaign": case, "arm": arm, "poses": poses, "verdict": verdict}


def sealed(case, *effects, robot="m900ib700", group="single"):
    document = truth(*effects, group=group)
    return document | {"campaign": case, "case": document["case"] | {"robot": robot}}


CLASS = verdict_of("class", "link_weight", alternatives=["payload@2"])
TRUTHS = {
    "a": sealed("a", "payload"),
    "b": sealed("b", "payload"),
    "c": sealed("c", "payload", robot="kuka"),
    "d": sealed("d", "payload", "joint_tilt", group="pair"),
}
ANEW = [
    entry("a", "proposed", 5, verdict_of("named", "payload")),
    *(entry("a", "random", poses, CLASS) for poses in (5, 10, 20)),
    entry("b", "proposed", 5, CLASS),
    entry("b", "proposed", 10, verdict_of("named", "link_weight")),
    entry("b", "random", 5, verdict_of("several", "payload", "joint_tilt")),
    entry("b", "random", 10, CLASS),
    entry("b", "random", 20, verdict_of("named", "payload")),
    *(entry(case, arm, 5, verdict_of("named", "payload")) for case in "cd" for arm in ("proposed", "random")),
]


@pytest.fixture
def cases():
    return followed(TRUTHS, dict.fromkeys("abcde", CLASS), ANEW, {"a": 2.0, "b": 30.0, "c": 0.0, "d": 100.0})


def row(table, *key):
    return table.set_index(["robots", "arm", "poses_added"]).loc[key]


def test_every_case_has_a_row_for_each_arm_and_number_of_poses(cases):
    assert len(cases) == 4 * 2 * 4
    assert set(cases["case"]) == set("abcd")


def test_rates_count_what_was_said_last(cases):
    table = rates(cases[with_one_effect(cases)])
    before = row(table, "proof", "proposed", 0)
    assert (before["cases"], before["right_name"], before["still_class"], before["wrong_name"]) == (2, 0, 2, 0)
    assert (before["low"], before["high"]) == (0, pytest.approx(beta.ppf(0.975, 1, 2)))
    for poses, right, still, wrong in ((5, 0.5, 1, 0), (10, 0.5, 0, 1), (20, 0.5, 0, 1)):
        found = row(table, "proof", "proposed", poses)
        assert (found["right_name"], found["still_class"], found["wrong_name"]) == (right, still, wrong)
    assert row(table, "proof", "random", 5)["other_verdict"] == 1
    assert row(table, "proof", "random", 20)["right_name"] == 0.5
    assert row(table, "tuned", "random", 20)["cases"] == 1


def test_promises_are_counted_of_cases_whose_proposal_makes_one_after_all_poses(cases):
    one = cases[with_one_effect(cases)]
    table = promises_kept(one).set_index(["robots", "quantity"])
    proposed = table.loc[("proof", "right name alone after proposed poses")]
    # Of case b, which alone promises 30; its proposed poses end in a wrong name and its random ones in the right one.
    assert (proposed.hits, proposed.cases, proposed.holds) == (0, 1, False)
    assert table.loc[("proof", "right name alone after random poses"), "hits"] == 1
    assert not table.loc[("proof", "proposed over random"), "holds"]
    assert "tuned" not in set(promises_kept(one).robots)
