"""What counts as a difference."""

import numpy as np
import pytest

from elastocal.audit.findings import compared, held


def test_equal_values_hold_even_where_nothing_is_allowed():
    assert compared("f", "c", "b", [1.0, np.nan, np.inf], [1.0, np.nan, np.inf], 0.0).holds


@pytest.mark.parametrize(("found", "holds"), [(1.0 + 0.9e-9, True), (1.0 + 1.1e-9, False), (np.nan, False), (np.inf, False)])
def test_a_difference_is_measured_by_the_largest_expected_value(found, holds):
    assert compared("f", "c", "b", [found, 0.5], [1.0, 0.5]).holds is holds


def test_a_scale_of_each_value_finds_what_the_largest_would_hide():
    assert compared("f", "c", "b", [1e3, 2e-9], [1e3, 1e-9]).holds
    assert not compared("f", "c", "b", [1e3, 2e-9], [1e3, 1e-9], scale=[1e3, 1e-9]).holds


def test_another_number_of_values_does_not_hold():
    assert "found 1 values, expected 2" in compared("f", "c", "b", [1.0], [1.0, 2.0]).note


def test_the_note_names_the_worst_value():
    assert compared("f", "c", "b", [1.0, 2.5], [1.0, 2.0]).note == "value 1: found 2.5, expected 2"


def test_a_statement_says_why_where_it_does_not_hold():
    assert held("f", "c", "b", True, "why").note == ""
    assert held("f", "c", "b", False, "why").note == "why"
    assert not held("f", "c", "b", False, "why").holds
