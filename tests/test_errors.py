"""The error of bad input: one line, with the place, what stands there and what may."""

from pathlib import Path

import pytest

from elastocal.errors import LONGEST_MESSAGE, InputError


def test_the_message_is_place_then_what_was_found_then_what_is_allowed():
    error = InputError("robot.yaml", "masses[2]", "-3 kg", "a positive mass")
    assert str(error) == "robot.yaml: masses[2]: found -3 kg; allowed: a positive mass"


def test_without_a_key_the_whole_file_is_the_place():
    assert str(InputError("robot.yaml", "", "nothing", "a robot")) == "robot.yaml: found nothing; allowed: a robot"


def test_the_message_stays_one_line_whatever_was_found():
    error = InputError("a.csv", "q1\n", "two\r\nlines,\ta tab\n\n", "one\nline")
    assert str(error) == "a.csv: q1: found two lines, a tab; allowed: one line"


def test_the_parts_can_be_read_one_by_one_as_they_were_given():
    error = InputError(Path("cells") / "a.csv", "q1", "two\nlines", "one")
    assert (error.source, error.key, error.found, error.allowed) == ("cells/a.csv", "q1", "two\nlines", "one")


def test_whoever_catches_value_errors_catches_bad_input():
    with pytest.raises(ValueError, match=r"^a\.csv: "):
        raise InputError("a.csv", "", "nothing", "rows")


@pytest.mark.parametrize("part", range(4))
def test_the_message_stays_short_whatever_stands_in_it(part):
    parts = ["a.csv", "q1", "one", "two"]
    parts[part] = "x" * 5_000_000
    message = str(InputError(*parts))
    assert len(message) <= LONGEST_MESSAGE and "…" in message
    assert all(word in message for number, word in enumerate(parts) if number != part)
    assert len(str(InputError(*["x" * 1000] * 4))) == LONGEST_MESSAGE


def test_what_would_steer_a_terminal_is_escaped():
    message = str(InputError("a\x1b.yaml", "\ud800", "\x1b[2Jµ", "\x07"))
    assert message == r"a\x1b.yaml: \ud800: found \x1b[2J\xb5".replace(r"\xb5", "µ") + r"; allowed: \x07"
