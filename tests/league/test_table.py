"""Figures of the league: errors with intervals, ratios on the same poses; the page has
each in words that a stranger knows."""

import pandas as pd
import pytest
from made_leagues import make_results

from elastocal_proof.league.methods import Method
from elastocal_proof.league.table import compare_methods, format_league_page

ROBOTS = {"A robot": ["one"], "Another": ["two"]}


METHODS = {
    "geometry": Method("geometry", words="geometry"),
    "half": Method("diagnosis", words="ours"),
    "process": Method("geometry", words="GP"),
}
MECHANISMS = pd.DataFrame(
    [
        {
            "robot": "A robot",
            "data": "one",
            "mechanism": name,
            "probability": p,
            "probability_low": p,
            "probability_high": p,
        }
        | {"share": s, "share_low": s, "share_high": s}
        for name, p, s in (("link_weight", 0.9, 0.4), ("payload", 0.01, 0.2))
    ]
)


def written(table):
    return format_league_page(table, MECHANISMS, METHODS, {"four": "folder/four.csv"})


@pytest.fixture(scope="module")
def page():
    return written(compare_methods(make_results(), ROBOTS, "geometry", 1))


def test_each_split_has_a_table_in_which_the_best_is_bold(page):
    assert page.count("## ") == 5
    for line in (
        line
        for line in page.splitlines()
        if line.startswith("| one ") and "(" in line and "**" in line
    ):
        assert line.count("**") == 2
    assert page.count("**") == 2 * 6


def test_a_split_that_no_data_set_has_is_left_out():
    page = written(
        compare_methods(
            make_results(splits=("random", "session")), ROBOTS, "geometry", 1
        )
    )
    assert (
        "Random poses" in page
        and "another session" in page
        and "Blocks of joint space" not in page
    )


def test_improbable_mechanisms_are_left_out(page):
    assert "link weight" in page and "payload" not in page


def test_the_page_says_first_how_often_a_diagnosis_leads_and_how_surely(page):
    results = make_results()
    assert (
        "has the smallest RMS error in 6 of 6 rows, in 6 with 95 % confidence" in page
    )
    assert "; another has it in 0, in 0 with that confidence." in page
    # The same entries under two names: one of them is smallest, and neither is ahead
    # for certain.
    twins = {
        (*key[:2], name): part
        for key, part in results.items()
        if key[2] == "geometry"
        for name in ("geometry", "half")
    }
    table = compare_methods(twins, ROBOTS, "geometry", 1)
    assert "has the smallest RMS error in 0 of 6 rows, in 0 with" in written(table)
    assert "; another has it in 6, in 0 with that confidence." in written(table)
