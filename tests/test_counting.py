"""Counts in messages and reports agree with their nouns."""

from elastocal.counting import format_count, format_integer, list_first


def test_a_count_of_one_is_singular_and_thousands_are_grouped():
    assert format_count(1, "row") == "1 row"
    assert format_count(0, "row") == "0 rows"
    assert format_count(2, "entry", "entries") == "2 entries"
    assert format_count(12000, "pose") == "12\u2009000 poses"
    assert format_integer(-1234567) == "-1\u2009234\u2009567"


def test_of_many_names_the_first_are_listed_and_the_others_counted():
    assert list_first(["a", "b"], 2) == "a, b"
    assert list_first(["a", "b", "c", "d", "e"], 2) == "a, b and 3 more"
