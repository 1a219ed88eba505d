"""What counts as a difference."""

import numpy as np
import pandas as pd
import pytest

from elastocal_proof.audit.findings import compare, compare_columns, require, require_each_once


def test_equal_values_hold_even_where_nothing_is_allowed():
    assert compare("c", "b", [1.0, np.nan, np.inf], [1.0, np.nan, np.inf], 0.0).holds


@pytest.mark.parametrize(("found", "holds"), [(1.0 + 0.9e-9, True), (1.0 + 1.1e-9, False), (np.nan, False), (np.inf, False)])
def test_a_difference_is_measured_by_the_largest_expected_value(found, holds):
    assert compare("c", "b", [found, 0.5], [1.0, 0.5]).holds is holds


def test_a_scale_of_each_value_finds_what_the_largest_would_hide():
    assert compare("c", "b", [1e3, 2e-9], [1e3, 1e-9]).holds
    assert not compare("c", "b", [1e3, 2e-9], [1e3, 1e-9], scale=[1e3, 1e-9]).holds


def test_another_number_of_values_does_not_hold():
    assert "found 1 values, expected 2" in compare("c", "b", [1.0], [1.0, 2.0]).note


def test_the_note_names_the_worst_value():
    assert compare("c", "b", [1.0, 2.5], [1.0, 2.0]).note == "value 1: found 2.5, expected 2"


def test_a_statement_says_why_where_it_does_not_hold():
    assert require("c", "b", True, "why").note == ""
    assert require("c", "b", False, "why").note == "why"
    assert not require("c", "b", False, "why").holds


def failed_columns(stored, expected):
    return [finding.checked for finding in compare_columns(stored, expected, ["name"]) if not finding.holds]


def test_columns_are_compared_one_by_one_and_the_rest_is_named():
    stated = pd.DataFrame({"name": ["a", "b"], "rate": [0.1, np.nan], "words": ["x", "y"], "holds": [True, False]})
    *_, last = compare_columns(stated, stated.drop(columns="words").iloc[::-1], ["name"])
    assert last.holds and last.checked == "6 of 8 cells followed; not words"
    assert failed_columns(stated, stated) == []
    assert failed_columns(stated, stated.assign(rate=[0.1001, np.nan])) == ["column rate"]
    assert failed_columns(stated, stated.assign(rate=[0.1, 0.2])) == ["column rate"]
    assert failed_columns(stated, stated.assign(rate=[0.1, pd.NA])) == []
    assert failed_columns(stated, stated.assign(holds=[True, True])) == ["column holds"]
    assert failed_columns(stated, stated.assign(name=["a", "c"])) == ["rows"]
    assert failed_columns(stated, stated.head(1)) == ["rows"]


def test_rows_are_numbered_by_all_combinations():
    frame = pd.DataFrame({"a": [0, 0, 1, 1], "b": [1, 2, 1, 2]})
    assert require_each_once(frame, a=range(2), b=range(1, 3)).holds
    assert not require_each_once(frame.head(3), a=range(2), b=range(1, 3)).holds
