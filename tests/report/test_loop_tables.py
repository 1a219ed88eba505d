"""Tables of a campaign's report: errors with intervals, what was measured, what is not determined, what to measure next."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import campaign_descriptions, experiment_rows, parameter_table, split_rows, step_rows

from elastocal import __version__
from elastocal.report.loop_tables import compliance_rows, held_rows, untestable_rows
from elastocal.report.loop_tables import step_rows as table_rows


def test_before_and_after_have_intervals_and_multiples():
    table = table_rows(step_rows(), 5e-5)
    assert table["unit"] == "µm" and [row["kind"] for row in table["rows"]] == ["frames", "declared", "effect"]
    cells = table["rows"][0]["cells"]
    assert cells[1:] == [["180", "[144, 216]", "3.60 × floor"], ["270", "≥ 216", "5.40 × floor"], ["300", "–", "6.00 × floor"]]
    assert table_rows(step_rows(largest_m=0.05), None)["rows"][0]["cells"][0] == ["25.000", "[20.000, 30.000]"]


def test_the_held_out_split_has_the_intervals_of_the_steps_and_many_blocks_are_left_out():
    verdict = CAMPAIGNS["named"]
    splits = facts_of(verdict, splits=split_rows(blocks=13))["splits"]
    assert (len(splits["rows"]), splits["left_out"], splits["changed"]) == (2, 13, True)
    low, high = (100 * end for end in verdict["heldout"]["reduction_ci95"])
    assert splits["rows"][0]["cells"][0][1] == "[101, 151]" and splits["rows"][0]["cells"][2][1] == f"[{low:.0f}, {high:.0f}]"


def test_the_next_experiment_is_in_degrees_and_says_what_it_brings():
    facts = facts_of(CAMPAIGNS["class"], experiment=experiment_rows(count=3))["experiment"]
    loads = ["fx N", "fy N", "fz N", "mx N·m", "my N·m", "mz N·m"]
    # All states have one point, which the caption names.
    assert facts["heads"] == [*(f"q{k} °" for k in range(1, 7)), *loads, "separation", "resolved"] and facts["points"] == "6DoF"
    angles, wrench = ["−5.7", "−11.5", "−17.2", "−22.9", "−28.6", "−34.4"], ["910", "0", "−412", "−206", "0", "455"]
    assert facts["rows"][2] == [*angles, *wrench, "12.0", "58\u00a0%"]
    unloaded = [row | dict.fromkeys(("fx", "fy", "fz", "mx", "my", "mz"), 0.0) for row in experiment_rows()]
    assert facts_of(CAMPAIGNS["class"], experiment=unloaded)["experiment"]["heads"][-3:-1] == ["q6 °", "separation"]


def test_what_was_measured_is_stated_apart_for_fitted_and_held_out_poses():
    facts = facts_of(CAMPAIGNS["named"], descriptions=campaign_descriptions(held_out="another"))
    measured = {name: (training, held_out) for name, training, held_out in facts["measured"]}
    assert measured["campaign"] == ("made_up", "another")
    assert measured["poses"] == ("20 poses in 1 session", "10 poses in 1 session")
    assert measured["loads"][0].startswith("1 load of 500 N on 50")
    assert facts["method"]["held_out"] == "10 poses of another campaign (another)"


def test_a_report_says_of_which_robot_it_is_and_has_every_setting_with_value_and_reason():
    descriptions = campaign_descriptions()
    assert facts_of(CAMPAIGNS["named"], descriptions=descriptions)["made"] == f"Report by elastocal {__version__}"
    descriptions["campaign"] |= {"serial_number": "4711", "measured_on": "2026-11-20"}
    facts = facts_of(CAMPAIGNS["named"], descriptions=descriptions)
    assert facts["made"] == f"Serial number 4711, measured on 2026-11-20, report by elastocal {__version__}"
    rows = facts["settings"]
    assert len(rows) == len(CAMPAIGNS["named"]["settings"]) and all(map(all, rows))
    assert ["alarm level", "0.02"] in [row[:2] for row in rows]
    assert ["scales", "0.01, 0.03, 0.1, 0.3, 1, 3"] in [row[:2] for row in rows]


def test_parameters_that_are_not_determined_are_gathered_by_owner_and_stand_apart():
    rows = held_rows(["joint_offset@1 offset", "link_geometry@1 dz", "link_geometry@1 ry"])
    assert rows == [["Zero offset of joint 1", "offset"], ["Geometric error of link 1", "shift along z, rotation about y"]]
    left = "joint_offset@3 offset"
    facts = facts_of(CAMPAIGNS["named"], parameters=parameter_table(["joint_offset@2 offset", left], by_prior=[left]))
    assert facts["held"] == [["Zero offset of joint 3", "offset"]]
    assert [row[0] for row in facts["others"]["rows"]] == ["Zero offset of joint 2"]


def test_what_cannot_be_tested_is_gathered_by_effect_and_reason_and_long_lists_are_cut():
    few = {f"lost_motion@{k}": "too few different angles of a joint" for k in (1, 2)}
    many = {f"cross_compliance@{k}+{k + 1}": "no approach in the data" for k in range(1, 10)}
    assert untestable_rows(few | many | {"payload": "no load"}) == [
        [
            "Elastic coupling",
            "joints 1 and 2, of joints 2 and 3, of joints 3 and 4 and of joints 4 and 5 and 5 more",
            "no direction of approach in the data",
        ],
        ["Weight of an undeclared payload", "–", "no load"],
        ["Lost motion (backlash)", "joints 1 and 2", "too few different angles of a joint"],
    ]


def test_of_a_compliance_that_is_not_identifiable_no_number_is_stated_and_of_a_file_that_fits_none_all_are():
    rows = compliance_rows({"before": [0.5, 0.4], "after": [0.48, 0.4], "std_error": [0.01, 0.0]})
    assert rows == [["1", "0.500", "0.480 ± 0.010"], ["2", "not identifiable", "not identifiable"]]
    assert compliance_rows({"before": [0.5], "after": [0.5], "std_error": [0.0]}) == [["1", "0.5", "0.5"]]
