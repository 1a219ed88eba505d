"""What was measured is told apart for the poses that are fitted and those that are held out."""

from made_loop_facts import CAMPAIGNS, facts_of
from made_loop_tables import campaign_descriptions


def test_what_was_measured_is_told_apart_for_fitted_and_held_out_poses():
    facts = facts_of(CAMPAIGNS["named"], descriptions=campaign_descriptions(held_out="another"))
    measured = {name: (training, held_out) for name, training, held_out in facts["measured"]}
    assert measured["campaign"] == ("made_up", "another")
    assert measured["poses"] == ("20 poses in 1 session", "10 poses in 1 session")
    assert measured["loads"][0].startswith("1 load of 500 N on 50")
    assert facts["method"]["where"] == " of another campaign (another)"
