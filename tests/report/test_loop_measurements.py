"""What was measured is told apart for the poses that are fitted and those that are held out."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import campaign_descriptions

from elastocal import __version__
from elastocal.report.loop_measurements import made


def test_what_was_measured_is_told_apart_for_fitted_and_held_out_poses():
    facts = facts_of(CAMPAIGNS["named"], descriptions=campaign_descriptions(held_out="another"))
    measured = {name: (training, held_out) for name, training, held_out in facts["measured"]}
    assert measured["campaign"] == ("made_up", "another")
    assert measured["poses"] == ("20 poses in 1 session", "10 poses in 1 session")
    assert measured["loads"][0].startswith("1 load of 500 N on 50")
    assert facts["method"]["where"] == " of another campaign (another)"


def test_a_report_says_of_which_robot_it_is_when_it_was_measured_and_by_which_version():
    assert made({"serial_number": "4711", "measured_on": "2026-11-20"}) == (
        f"Serial number 4711, measured on 2026-11-20, report by elastocal {__version__}"
    )
    assert made({}) == f"Report by elastocal {__version__}"
