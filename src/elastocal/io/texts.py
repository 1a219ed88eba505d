"""Bytes and texts of files that people hand in, and the numbers in them: bounded, and
of regular files alone."""

import math
import os
import re
import stat
from pathlib import Path

from elastocal.errors import InputError, describe_os_error

# Python also takes 1_0 for 10, other scripts' digits, and words for what is no number.
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
# No length, angle, force, mass or time of a robot is larger in any unit; squares and
# products of such numbers are finite.
LARGEST_NUMBER = 1e12
NUMBER_ALLOWED = f"a number such as -0.25 or 2.5e-3, up to {LARGEST_NUMBER:g} in size"
_LONGEST_NUMBER = 100


def describe_file_kind(mode: int) -> str:
    """What has a name, by the mode of its status."""
    kinds = {
        stat.S_IFREG: "file",
        stat.S_IFLNK: "link",
        stat.S_IFDIR: "folder",
        stat.S_IFIFO: "pipe",
        stat.S_IFSOCK: "socket",
    }
    return f"a {kinds.get(stat.S_IFMT(mode), 'device')}"


def check_file(path: str | Path, kind: str = "the path of a readable file") -> int:
    """Size of a file in bytes; a pipe or a device is refused before it is opened, as it
    might never end."""
    status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise InputError(path, "", describe_file_kind(status.st_mode), kind)
    return status.st_size


def read_bytes(
    path: str | Path, largest: int, kind: str = "the path of a readable file"
) -> bytes:
    """Contents of a file of at most so many bytes; `kind` is what it should be, for
    messages.

    An InputError refuses what is not there or may not be read, and a pipe or device,
    which might never end.
    """
    try:
        if check_file(path, kind) <= largest:
            with open(path, "rb") as file:
                content = file.read(largest + 1)
            if len(content) <= largest:
                return content
        raise InputError(
            path, "", f"more than {largest} bytes", f"{kind} of at most {largest} bytes"
        )
    except OSError as error:
        raise InputError(path, "", describe_os_error(error), kind) from None
    except ValueError as error:
        # A null character in the path; but an InputError is one too.
        if isinstance(error, InputError):
            raise
        raise InputError(path, "", str(error), kind) from None


def read_text(
    path: str | Path, largest: int, kind: str = "the path of a readable file"
) -> str:
    """Contents of a file in UTF-8, see `read_bytes`, without the byte order mark that
    spreadsheets write."""
    return decode_text(read_bytes(path, largest, kind), path)


def decode_text(content: bytes, path: str | Path, encoding: str = "utf-8-sig") -> str:
    """Text of the contents of a file; an InputError names the line of what is in
    another encoding."""
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        # Its object may lack the mark in front; lines are the same.
        line = error.object[: error.start].count(b"\n") + 1
        name = encoding.upper().removesuffix("-SIG")
        raise InputError(
            path,
            f"line {line}",
            f"text that is not {name} (byte {error.start})",
            "a UTF-8 file",
        ) from None


def parse_number(text: str, largest: float = LARGEST_NUMBER) -> float | None:
    """A decimal number as people write it; None for words, not-a-number, digits with
    underscores, and what is larger."""
    value = (
        float(text)
        if len(text) <= _LONGEST_NUMBER and _NUMBER.fullmatch(text)
        else math.inf
    )
    return value if abs(value) <= largest else None
