"""Counts in messages and reports agree with their nouns."""

import pytest

from elastocal.counting import format_count, format_digits, format_integer, list_first


def test_a_count_of_one_is_singular_and_thousands_are_grouped():
    assert format_count(1, "row") == "1 row"
    assert format_count(0, "row") == "0 rows"
    assert format_count(2, "entry", "entries") == "2 entries"
    assert format_count(12000, "pose") == "12\u2009000 poses"
    assert format_integer(-1234567) == "-1\u2009234\u2009567"


def test_of_many_names_the_first_are_listed_and_the_others_counted():
    assert list_first(["a", "b"], 2) == "a, b"
    assert list_first(["a", "b", "c", "d", "e"], 2) == "a, b and 3 more"


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (104.0, 2, "100"),
        (99.6, 2, "100"),
        (-123456.0, 3, "-123000"),
        (0.00123, 2, "0.0012"),
        (1.24e-9, 2, "1.2e-09"),
        (0.0, 2, "0"),
    ],
)
def test_a_large_number_has_no_exponent(value, digits, text):
    assert format_digits(value, digits) == text
