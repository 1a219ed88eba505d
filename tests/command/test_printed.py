"""What a document prints as it is stands on one line; a date is one of the calendar."""

import io

import pytest
from rich.console import Console
from support import refused

from elastocal.command.printed import iso_date, print_lines, printed


@pytest.mark.parametrize("text", ["", "  ", "47\n11", "4711\n", "47\t11", "47\x1b[31m", "47\u202811", "47\u202e11", "4" * 61])
def test_nothing_or_more_than_a_line_is_refused(text):
    with refused("--serial", "", "1 to 60 characters on one line"):
        printed("--serial", text)


@pytest.mark.parametrize(
    "text", ["", "today", "20.11.2026", "20261120", "2026-W47-5", "2026-02-29", "2026-13-01", "2026-11-20\n", " 2026-11-20"]
)
def test_anything_else_than_a_date_of_the_calendar_is_refused(text):
    with refused("--date", "", "such as 2026-11-20"):
        iso_date("--date", text)


def test_lines_are_printed_as_they_are_but_for_what_would_steer_a_terminal():
    console = Console(file=io.StringIO())
    print_lines(["    [bold] a\x1b[2Jb\u202ec 4.00\u00a0mm"], console)
    assert console.file.getvalue() == "    [bold] a\\x1b[2Jb\\u202ec 4.00\u00a0mm\n"
