"""A count and its noun agree, wherever a message or a report has one."""

from elastocal.counting import format_count, format_integer, list_first


def test_one_thing_is_no_plural_and_thousands_are_grouped():
    assert (
        format_count(1, "row") == "1 row"
        and format_count(0, "row") == "0 rows"
        and format_count(2, "entry", "entries") == "2 entries"
    )
    assert (
        format_count(12000, "pose") == "12\u2009000 poses"
        and format_integer(-1234567) == "-1\u2009234\u2009567"
    )


def test_of_many_names_the_first_are_written_and_the_others_counted():
    assert (
        list_first(["a", "b"], 2) == "a, b"
        and list_first(["a", "b", "c", "d", "e"], 2) == "a, b and 3 more"
    )
