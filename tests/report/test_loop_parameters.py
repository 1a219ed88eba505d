"""Parameters that the measurements do not determine are told apart from those that they do."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import parameter_table

from elastocal.report.loop_parameters import held_rows


def test_held_parameters_are_gathered_by_owner():
    rows = held_rows(["joint_offset@1 offset", "link_geometry@1 dz", "link_geometry@1 ry"])
    assert rows == [["Zero offset of joint 1", "offset"], ["Geometric error of link 1", "shift along z, rotation about y"]]


def test_what_only_the_prior_determines_is_listed_as_not_identified():
    left = "joint_offset@3 offset"
    facts = facts_of(CAMPAIGNS["named"], parameters=parameter_table(["joint_offset@2 offset", left], by_prior=[left]))
    assert facts["held"] == [["Zero offset of joint 3", "offset"]]
    assert [row[0] for row in facts["others"]["rows"]] == ["Zero offset of joint 2"]
