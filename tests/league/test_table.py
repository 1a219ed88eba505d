"""Errors of the benchmark with their intervals and ratios, and the page that shows
them."""

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


def make_mechanism(name, probability, share):
    return {
        "robot": "A robot",
        "data": "one",
        "mechanism": name,
        "probability": probability,
        "probability_low": probability,
        "probability_high": probability,
        "share": share,
        "share_low": share,
        "share_high": share,
    }


MECHANISMS = pd.DataFrame(
    [make_mechanism("link_weight", 0.9, 0.4), make_mechanism("payload", 0.01, 0.2)]
)


def make_page(results):
    table = compare_methods(results, ROBOTS, "geometry", 1)
    return format_league_page(table, MECHANISMS, METHODS, {"four": "folder/four.csv"})


@pytest.fixture(scope="module")
def page():
    return make_page(make_results())


def test_each_split_has_a_table_in_which_the_best_is_bold(page):
    assert page.count("## ") == 5
    for line in page.splitlines():
        if line.startswith("| one ") and "(" in line and "**" in line:
            assert line.count("**") == 2
    assert page.count("**") == 2 * 6


def test_a_split_that_no_data_set_has_is_left_out():
    page = make_page(make_results(splits=("random", "session")))
    assert "Random poses" in page
    assert "another session" in page
    assert "Blocks of joint space" not in page


def test_improbable_mechanisms_are_left_out(page):
    assert "link weight" in page
    assert "payload" not in page


def test_the_page_begins_with_how_often_a_diagnosing_method_is_best(page):
    assert (
        "has the smallest RMS error in 6 of 6 rows, in 6 with 95 % confidence" in page
    )
    assert "; another has it in 0, in 0 with that confidence." in page


def test_methods_with_equal_errors_lead_without_confidence():
    # The same entries under two names.
    results = {}
    for (data, split, method), entries in make_results().items():
        if method == "geometry":
            results[data, split, "geometry"] = entries
            results[data, split, "half"] = entries
    page = make_page(results)
    assert "has the smallest RMS error in 0 of 6 rows, in 0 with" in page
    assert "; another has it in 6, in 0 with that confidence." in page
