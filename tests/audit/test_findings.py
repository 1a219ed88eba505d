"""What counts as a difference."""

import numpy as np
import pandas as pd
import pytest

from elastocal_proof.audit.findings import compare, require, require_each_once


def test_equal_values_hold_even_where_nothing_is_allowed():
    assert compare("c", "b", [1.0, np.nan, np.inf], [1.0, np.nan, np.inf], 0.0).holds


@pytest.mark.parametrize(("found", "holds"), [(1.0 + 0.9e-9, True), (1.0 + 1.1e-9, False), (np.nan, False), (np.inf, False)])
def test_a_difference_is_measured_by_the_largest_expected_value(found, holds):
    assert compare("c", "b", [found, 0.5], [1.0, 0.5]).holds is holds


def test_a_note_names_the_worst_value_or_another_number_of_values():
    assert compare("c", "b", [1.0, 2.5], [1.0, 2.0]).note == "value 1: found 2.5, expected 2"
    assert "found 1 values, expected 2" in compare("c", "b", [1.0], [1.0, 2.0]).note


def test_a_statement_says_why_where_it_does_not_hold():
    assert require("c", "b", True, "why").note == "" and require("c", "b", True).holds
    assert require("c", "b", False, "why").note == "why" and not require("c", "b", False).holds


def test_rows_are_numbered_by_all_combinations():
    frame = pd.DataFrame({"a": [0, 0, 1, 1], "b": [1, 2, 1, 2]})
    assert require_each_once(frame, a=range(2), b=range(1, 3)).holds
    assert not require_each_once(frame.head(3), a=range(2), b=range(1, 3)).holds
