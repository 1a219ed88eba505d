"""The method stands with every setting, and with every candidate that could not be tested."""

from made_loop_facts import CAMPAIGNS, facts_of


def test_every_setting_is_listed_with_value_and_reason():
    rows = facts_of(CAMPAIGNS["named"])["settings"]
    assert len(rows) == len(CAMPAIGNS["named"]["settings"]) and all(map(all, rows))
    assert ["alarm level", "0.02"] in [row[:2] for row in rows]
    assert ["scales", "0.01, 0.03, 0.1, 0.3, 1, 3"] in [row[:2] for row in rows]
