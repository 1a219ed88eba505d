"""The one error that bad input raises."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


# A terminal shows a message as a whole: files may hold values of any length.
LONGEST_MESSAGE = 500
_LONGEST_SOURCE, _LONGEST_KEY, _LONGEST_FOUND = 160, 100, 120


class InputError(ValueError):
    """Something that a user gave cannot be used; the message is one line of `LONGEST_MESSAGE` characters at most.

    Parameters
    ----------
    source : str
        The file, or the name of the thing, that holds the fault.
    key : str
        The key, row or column inside it; empty where the whole file is meant.
    found : str
        What stands there.
    allowed : str
        What may stand there.
    """

    def __init__(self, source: str | Path, key: str, found: str, allowed: str) -> None:
        self.source, self.key, self.found, self.allowed = str(source), key, found, allowed
        name = printable(self.source)
        where = name if len(name) <= _LONGEST_SOURCE else f"…{name[1 - _LONGEST_SOURCE :]}"
        where += f": {_shortened(printable(key), _LONGEST_KEY)}" if key else ""
        message = f"{where}: found {_shortened(printable(found), _LONGEST_FOUND)}; allowed: "
        super().__init__(message + _shortened(printable(allowed), LONGEST_MESSAGE - len(message)))


def printable(text: str) -> str:
    """A text on one line, control characters as their escapes: what a file holds must not steer a terminal.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
    """
    line = " ".join(text.split())
    return line if line.isprintable() else "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)


def _shortened(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
