"""Parameters that the measurements do not determine are told apart from those that they do."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import parameter_table

from elastocal.report.loop_parameters import compliance_rows, held_rows


def test_held_parameters_are_gathered_by_owner():
    rows = held_rows(["joint_offset@1 offset", "link_geometry@1 dz", "link_geometry@1 ry"])
    assert rows == [["Zero offset of joint 1", "offset"], ["Geometric error of link 1", "shift along z, rotation about y"]]


def test_what_only_the_prior_determines_is_listed_as_not_identified():
    left = "joint_offset@3 offset"
    facts = facts_of(CAMPAIGNS["named"], parameters=parameter_table(["joint_offset@2 offset", left], by_prior=[left]))
    assert facts["held"] == [["Zero offset of joint 3", "offset"]]
    assert [row[0] for row in facts["others"]["rows"]] == ["Zero offset of joint 2"]


def test_of_a_compliance_that_is_not_identifiable_no_number_is_stated_and_of_a_file_that_fits_none_all_are():
    rows = compliance_rows({"before": [0.5, 0.4], "after": [0.48, 0.4], "std_error": [0.01, 0.0]})
    assert rows == [["1", "0.500", "0.480 ± 0.010"], ["2", "not identifiable", "not identifiable"]]
    assert compliance_rows({"before": [0.5], "after": [0.5], "std_error": [0.0]}) == [["1", "0.5", "0.5"]]
