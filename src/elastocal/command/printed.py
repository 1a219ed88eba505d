"""What is printed: options of documents as they are, names and numbers on one line, and dates; and answers on a terminal."""

from __future__ import annotations

from datetime import date
from typing import TYPE_CHECKING

from elastocal.errors import InputError, escaped, steering

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

# As in campaign.yaml.
_LONGEST = 60


def printed(option: str, text: str) -> str:
    """A text that a document prints as it is, without the blanks around it; it has to stand on one line of it."""
    line = text.strip(" ")
    if steering(line) or not 0 < len(line) <= _LONGEST:
        raise InputError(option, "", repr(text), f"1 to {_LONGEST} characters on one line")
    return line


def iso_date(option: str, text: str) -> str:
    """A day of the calendar as ISO 8601 writes it with hyphens, such as ``2026-11-20``; anything else is refused."""
    try:
        day = date.fromisoformat(text).isoformat()
    except ValueError:
        day = ""
    # Python also reads 20261120 and 2026-W47-5, which a reader of the document may not.
    if day != text or not text:
        raise InputError(option, "", repr(text), "a date of the calendar as ISO 8601 has it, such as 2026-11-20")
    return day


def example(*commands: str) -> str:
    """The end of a help text: commands to type, on lines that are not wrapped."""
    # \b keeps click from joining the lines of a paragraph.
    return "\n".join(["\b", "Example:" if len(commands) == 1 else "Examples:", *(f"  {command}" for command in commands)])


def print_answer(passed: bool, answer: str, details: Iterable[str], following: str, console: Console) -> None:
    """Print an answer with its mark, ✓ or !, then its details and the command that comes next, if any.

    A detail that asks for attention begins with "! " already.
    """
    lines = [f"{'✓' if passed else '!'} {answer}", *(line if line.startswith("! ") else f"  {line}" for line in details)]
    print_lines([*lines, *([f"next: {following}"] if following else [])], console)


def print_lines(lines: Iterable[str], console: Console) -> None:
    """Print lines as they are, with what would steer a terminal as escapes: they hold names and paths of other people."""
    for line in lines:
        console.print(escaped(line), markup=False, highlight=False, soft_wrap=True)
