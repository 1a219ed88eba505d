"""Read bytes, texts and numbers from files that people hand in: bounded in size, and
from regular files only."""

import os
import re
import stat
from pathlib import Path

from elastocal.errors import InputError, describe_os_error

# A decimal number as people write it. Python's float also accepts 1_0, digits of other
# scripts, "nan" and "inf".
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
# Upper bound on a number: no length, angle, force, mass or time of a robot is larger in
# any unit. Squares and products of such numbers are finite.
LARGEST_NUMBER = 1e12
NUMBER_ALLOWED = f"a number such as -0.25 or 2.5e-3, up to {LARGEST_NUMBER:g} in size"
# Upper bound on the characters of a number, so that parsing it takes no time.
_LONGEST_NUMBER = 100


def describe_file_kind(mode: int) -> str:
    """Return the kind of a file, such as "a link", from the mode of its status."""
    kinds = {
        stat.S_IFREG: "file",
        stat.S_IFLNK: "link",
        stat.S_IFDIR: "folder",
        stat.S_IFIFO: "pipe",
        stat.S_IFSOCK: "socket",
    }
    return f"a {kinds.get(stat.S_IFMT(mode), 'device')}"


def check_file(path: str | Path, kind: str = "the path of a readable file") -> int:
    """Return the size of a file in bytes. A pipe or a device, which might never end, is
    refused before it is opened."""
    status = os.stat(path)
    if not stat.S_ISREG(status.st_mode):
        raise InputError(path, "", describe_file_kind(status.st_mode), kind)
    return status.st_size


def read_bytes(
    path: str | Path, largest: int, kind: str = "the path of a readable file"
) -> bytes:
    """Read a file of at most `largest` bytes.

    Parameters
    ----------
    path : file.
    largest : largest size in bytes.
    kind : kind of file that is expected, for messages.

    Raises
    ------
    InputError
        If the file does not exist, cannot be read, is too large, or is a pipe or a
        device, which might never end.
    """
    try:
        size = check_file(path, kind)
        if size <= largest:
            with open(path, "rb") as file:
                # A file may grow while it is read.
                content = file.read(largest + 1)
            if len(content) <= largest:
                return content
    except InputError:
        raise
    except OSError as error:
        raise InputError(path, "", describe_os_error(error), kind) from None
    except ValueError as error:
        # The path has a null character.
        raise InputError(path, "", str(error), kind) from None
    finding = f"more than {largest} bytes"
    raise InputError(path, "", finding, f"{kind} of at most {largest} bytes")


def read_text(
    path: str | Path, largest: int, kind: str = "the path of a readable file"
) -> str:
    """Read a file in UTF-8 as `read_bytes`, without the byte order mark that
    spreadsheets write."""
    return decode_text(read_bytes(path, largest, kind), path)


def decode_text(content: bytes, path: str | Path, encoding: str = "utf-8-sig") -> str:
    """Return the text of a file's contents; an InputError names the line that has
    another encoding."""
    try:
        return content.decode(encoding)
    except UnicodeDecodeError as error:
        # The error's bytes may lack the byte order mark, which does not change the line.
        line = error.object[: error.start].count(b"\n") + 1
        name = encoding.upper().removesuffix("-SIG")
        raise InputError(
            path,
            f"line {line}",
            f"text that is not {name} (byte {error.start})",
            "a UTF-8 file",
        ) from None


def parse_number(text: str, largest: float = LARGEST_NUMBER) -> float | None:
    """Return the decimal number that a text states; None for words, NaN, digits with
    underscores, and a number beyond the largest size."""
    if len(text) > _LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if abs(value) <= largest else None
