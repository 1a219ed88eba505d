"""Files of users are bounded, regular and UTF-8, and numbers are decimal."""

import os

import pytest
from support import refused

from elastocal.io.texts import LARGEST_NUMBER, parse_number, read_bytes, read_text


def test_files_are_read_up_to_a_bound_and_pipes_are_not_opened(
    tmp_path,
):
    path = tmp_path / "a.txt"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    with refused(path, "", "more than 4 bytes", "a table of at most 4 bytes"):
        read_bytes(path, 4, "a table")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "loop").symlink_to("loop")
    for name, finding in (
        ("pipe", "a pipe"),
        ("zero", "a device"),
        ("loop", "Too many levels"),
        ("", "a folder"),
    ):
        with refused(tmp_path / name, "", finding):
            read_bytes(tmp_path / name, 10)
    for name, finding in (
        ("none", "no such file; allowed: the path of a readable file"),
        ("a\0b", "null"),
    ):
        with refused("", "", finding):
            read_bytes(tmp_path / name, 10)


def test_a_byte_order_mark_is_removed_and_another_encoding_is_refused(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("é\r\n", encoding="utf-8-sig", newline="")
    assert read_text(path, 100) == "é\r\n"
    path.write_bytes(b"a\nb\n\xe9\n")
    with refused(path, "line 3", "not UTF-8 (byte 4)"):
        read_text(path, 100)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0),
        ("-1.5e-3", -1.5e-3),
        ("+.5", 0.5),
        ("2.", 2.0),
        ("1e12", LARGEST_NUMBER),
    ],
)
def test_decimal_numbers_are_parsed(text, value):
    assert parse_number(text) == value
