"""The error of bad input is one line: where, what was found and what is allowed."""

import errno
import pickle
from pathlib import Path

import pytest

from elastocal.errors import (
    LONGEST_MESSAGE,
    InputError,
    describe_system_fault,
    escape_control_characters,
    explain_missing_packages,
    find_control_character,
    suggest_names,
)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            ("robot.yaml", "masses[2]", "-3 kg", "a mass"),
            "robot.yaml: masses[2]: found -3 kg; allowed: a mass",
        ),
        (
            (Path("a.csv"), "q1\n", "two\r\nlines,\ta tab\n\n", "1\nline"),
            "a.csv: q1: found two lines, a tab; allowed: 1 line",
        ),
    ],
)
def test_the_message_is_one_line_and_the_error_keeps_its_parts(parts, message):
    error = InputError(*parts)
    assert str(error) == message
    assert (error.source, error.key, error.found, error.allowed) == (
        str(parts[0]),
        *parts[1:],
    )


def test_another_process_gets_the_error_with_its_parts():
    error = InputError("a.yaml", "key", "x", "y")
    received = pickle.loads(pickle.dumps(error))
    assert str(received) == str(error) and vars(received) == vars(error)


def test_the_closest_allowed_name_comes_first_regardless_of_its_case():
    assert suggest_names("KUKE", ["abb", "kuka"]) == "'kuka'? (abb, kuka)"
    assert suggest_names("joint", ["abb", "kuka"]) == "abb, kuka"


@pytest.mark.parametrize("long_index", range(4))
def test_the_message_stays_short_if_one_of_its_parts_is_very_long(long_index):
    parts = ["a.csv", "q1", "one", "two"]
    parts[long_index] = "x" * 5_000_000
    message = str(InputError(*parts))
    assert len(message) <= LONGEST_MESSAGE
    assert "…" in message
    for index, text in enumerate(parts):
        assert index == long_index or text in message
    assert len(str(InputError(*["x" * 1000] * 4))) == LONGEST_MESSAGE


def test_characters_that_would_control_a_terminal_are_escaped():
    message = str(InputError("a\x1b.yaml", "\ud800", "\x1b[2Jµ", "\x07"))
    assert (
        message
        == r"a\x1b.yaml: \ud800: found \x1b[2J\xb5".replace(r"\xb5", "µ")
        + r"; allowed: \x07"
    )


@pytest.mark.parametrize(
    ("text", "character"),
    [("a\x1bb", "\x1b"), ("a\u202eb", "\u202e"), ("a\nb", "\n"), ("KR\u00a0270 é", "")],
)
def test_the_first_control_character_is_found_and_escaped(text, character):
    assert find_control_character(text) == character
    assert escape_control_characters(text) == (
        text.replace(character, ascii(character)[1:-1]) if character else text
    )


@pytest.mark.parametrize(
    ("error", "phrase"),
    [
        (
            OSError(errno.ENOSPC, "No space left on device", "a"),
            "a: found No space left on device; allowed: a file or folder that is there,"
            " on a disk with space",
        ),
        (
            MemoryError(),
            "memory: found none left; allowed: a smaller file, more memory",
        ),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "memory: found none left"),
        (
            ImportError("No module named 'x'"),
            "Python: found No module named 'x'; allowed: an environment",
        ),
        (
            PermissionError(
                13, "Permission denied", "a/go.csv.0123456789abcdef.partial/go.csv"
            ),
            "a/go.csv: found Permission denied",
        ),
    ],
)
def test_a_fault_of_the_machine_is_one_line_with_a_remedy(error, phrase):
    assert phrase in str(describe_system_fault(error, "here"))


def test_a_missing_package_of_an_extra_is_explained():
    missing = ModuleNotFoundError("no typst", name="typst.sub")
    with (
        pytest.raises(InputError, match=r"no package typst.*-e '\.\[report\]'"),
        explain_missing_packages(),
    ):
        raise missing


def test_another_missing_package_is_left_to_the_caller():
    missing = ModuleNotFoundError("no numpy", name="numpy")
    with pytest.raises(ModuleNotFoundError), explain_missing_packages():
        raise missing
