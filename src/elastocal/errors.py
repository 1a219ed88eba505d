"""The one error that bad input raises."""

from __future__ import annotations

import difflib
import errno
import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path


# A terminal shows a message as a whole: files may hold values of any length.
LONGEST_MESSAGE = 500
# Tables hold names, and spreadsheets open tables; those of some countries take the wide
# signs too.
_FORMULA = tuple("=+-@＝＋－＠")
_LONGEST_SOURCE = 160
_LONGEST_KEY = 100
_LONGEST_FOUND = 120


class InputError(ValueError):
    """Something that a user gave cannot be used; the message is one line of
    `LONGEST_MESSAGE` characters at most.

    `source`: the file, or the name of the thing, that holds the fault. `key`: the key,
    row or column inside it; empty where the whole file is meant. `found`: what stands
    there. `allowed`: what may stand there.
    """

    def __init__(self, source: str | Path, key: str, found: str, allowed: str) -> None:
        self.source = str(source)
        self.key = key
        self.found = found
        self.allowed = allowed
        name = format_printable(self.source)
        where = (
            name if len(name) <= _LONGEST_SOURCE else f"…{name[1 - _LONGEST_SOURCE :]}"
        )
        where += f": {_shortened(format_printable(key), _LONGEST_KEY)}" if key else ""
        message = f"{where}: found {_shortened(format_printable(found), _LONGEST_FOUND)}; allowed: "
        super().__init__(
            message
            + _shortened(format_printable(allowed), LONGEST_MESSAGE - len(message))
        )


def suggest_names(name: str, known: Collection[str]) -> str:
    """What is allowed instead of a name: the closest first."""
    listed = ", ".join(known)
    return f"{hint} ({listed})" if (hint := suggest_name(name, known)) else listed


def suggest_name(name: str, known: Collection[str]) -> str:
    """The closest of some names as a question, whatever the case of its letters; empty
    where none is close."""
    lower = {other.lower(): other for other in known}
    close = difflib.get_close_matches(str(name).lower(), lower, n=1)
    return f"{lower[close[0]]!r}?" if close else ""


def format_printable(text: str) -> str:
    """A text on one line, `escaped`."""
    return escape_control_characters(" ".join(text.split()))


def escape_control_characters(text: str) -> str:
    """A text with what `steering` finds as escapes: what a file holds must not steer a
    terminal."""
    return (
        text
        if text.isprintable()
        else "".join(ascii(c)[1:-1] if find_control_character(c) else c for c in text)
    )


def find_control_character(text: str) -> str:
    """The first control character of a text, or mark that turns the order of letters or
    is not seen; empty where none is."""
    return (
        ""
        if text.isprintable()
        else next(
            (
                c
                for c in text
                if not (c.isprintable() or unicodedata.category(c) == "Zs")
            ),
            "",
        )
    )


def find_text_fault(text: str) -> tuple[str, str] | None:
    """What is wrong with a name or text that reports, tables and terminals show, and
    what is allowed; None where nothing is."""
    if character := find_control_character(text):
        return (
            f"the character {character!a} in {text!r}",
            "printable characters on one line",
        )
    if text.startswith(_FORMULA):
        return (
            repr(text),
            f"a text that does not begin with {text[0]}, which a spreadsheet takes for a formula",
        )
    return None


_PARTIAL = re.compile(r"\.[0-9a-f]{16}\.partial\b.*")
# What the loader of libraries says of it.
_NO_MEMORY = ("failed to map segment", "annot allocate memory")
_USABLE = "a file or folder that is there, on a disk with space, where this user may read and write"


def describe_system_fault(
    error: OSError | MemoryError | ImportError, place: str = "disk"
) -> InputError:
    """A full disk, a folder that cannot be written to, memory that is used up and the
    like; at `place` where it has no name."""
    if isinstance(error, MemoryError) or any(
        words in str(error) for words in _NO_MEMORY
    ):
        return InputError(
            "memory",
            "",
            "none left",
            "a smaller file, more memory, or fewer jobs at a time (-j1)",
        )
    if isinstance(error, ImportError):
        return InputError(
            "Python",
            "",
            str(error),
            "an environment with every package of this version",
        )
    # What was asked for, not the name beside it under which it is written.
    return InputError(
        _PARTIAL.sub("", str(error.filename or place)),
        "",
        describe_os_error(error),
        _USABLE,
    )


def describe_os_error(error: OSError) -> str:
    """What was found where something could not be read or written, in words that fit a
    sentence."""
    return (
        "no such file" if error.errno == errno.ENOENT else error.strerror or str(error)
    )


def _shortened(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
