"""The method stands with every setting, and with every candidate that could not be tested."""

import pytest
from made_loop_facts import CAMPAIGNS, facts_of

from elastocal.report.loop_method import method, untestable_rows


def test_every_setting_is_listed_with_value_and_reason():
    rows = facts_of(CAMPAIGNS["named"])["settings"]
    assert len(rows) == len(CAMPAIGNS["named"]["settings"]) and all(map(all, rows))
    assert ["alarm level", "0.02"] in [row[:2] for row in rows]
    assert ["scales", "0.01, 0.03, 0.1, 0.3, 1, 3"] in [row[:2] for row in rows]


def test_candidates_that_cannot_be_tested_are_gathered_by_reason():
    reason = "4{} angles of joint {} where 72 are needed"
    harmonics = {f"transmission_harmonic@{k}[orders 13-18]": reason.format(k, k) for k in (1, 2)}
    assert untestable_rows(CAMPAIGNS["named"]["untestable"] | harmonics) == [
        ["Hysteresis", "joints 1, 2 and 3", "no direction of approach in the data"],
        ["Drift of the tracker or of the robot's foot", "–", "no time in the data"],
        ["Gear transmission error", "joints 1 and 2: orders 13-18", "too few different joint angles"],
    ]


@pytest.mark.parametrize(
    ("compliance", "stated", "rigid"), [("nominal", True, False), ("nominal", False, True), ("identify", False, False)]
)
def test_joints_are_rigid_where_their_compliances_are_neither_stated_nor_identified(compliance, stated, rigid):
    described = {"campaign": {"compliance": compliance, "declared": []}, "held_out": None, "robot": {"name": "x"}}
    if stated:
        described["robot"]["compliance_urad_per_Nm"] = [1.0]
    settings = {name: {"value": 0.1} for name in ("alarm_draws", "alarm_level", "mechanism_probability", "ambiguity_loss")}
    verdict = {"settings": settings, "candidates_tested": 1, "untestable": {}, "heldout": {"poses": 3}}
    assert method(verdict, described)["rigid"] == rigid
