"""The one error that bad input raises."""

from __future__ import annotations

import difflib
import errno
import re
import unicodedata
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator
    from pathlib import Path


# Upper bound on a message, which a terminal shows as a whole: files may hold values of
# any length.
LONGEST_MESSAGE = 500
_LONGEST_SOURCE = 160
_LONGEST_KEY = 100
_LONGEST_FOUND = 120
# Tables hold names, and spreadsheets open tables and take a text that begins with one
# of these for a formula, in some countries also with the wide characters.
_FORMULA = tuple("=+-@＝＋－＠")
# Name under which a file is being written, see `io.atomic_writes`.
_PARTIAL = re.compile(r"\.[0-9a-f]{16}\.partial\b.*")
# Messages of the loader of shared libraries if memory is used up.
_NO_MEMORY = ("failed to map segment", "annot allocate memory")
# Packages that only some functions need, with the extra of pyproject.toml that installs
# them.
EXTRAS = {
    "matplotlib": "report",
    "tabulate": "report",
    "typst": "report",
    "grimp": "pipeline",
    "pooch": "pipeline",
    "snakemake": "pipeline",
    "mujoco": "proof",
    "statsmodels": "proof",
    "pinocchio": "audit",
    "cv2": "camera",
}
_USABLE = (
    "a file or folder that is there, on a disk with space, where this user may read "
    "and write"
)


class InputError(ValueError):
    """Something that a user gave cannot be used. The message is one line of at most
    `LONGEST_MESSAGE` characters.

    Attributes
    ----------
    source : file, or name of the thing, that has the fault.
    key : key, row or column inside the source; empty if the whole source is at fault.
    found : what was found.
    allowed : what is allowed there.
    """

    def __init__(self, source: str | Path, key: str, found: str, allowed: str) -> None:
        self.source = str(source)
        self.key = key
        self.found = found
        self.allowed = allowed
        place = format_printable(self.source)
        if len(place) > _LONGEST_SOURCE:
            place = f"…{place[1 - _LONGEST_SOURCE :]}"
        if key:
            place += f": {_shorten(format_printable(key), _LONGEST_KEY)}"
        found = _shorten(format_printable(found), _LONGEST_FOUND)
        message = f"{place}: found {found}; allowed: "
        message += _shorten(format_printable(allowed), LONGEST_MESSAGE - len(message))
        super().__init__(message)

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str, str]]:
        """Keep the parts in a pickle, with which processes pass on an error."""
        return InputError, (self.source, self.key, self.found, self.allowed)


def suggest_names(name: str, known: Collection[str]) -> str:
    """Return the known names for a message, with the one closest to a wrong name as a
    question first."""
    names = ", ".join(known)
    suggestion = suggest_name(name, known)
    return f"{suggestion} ({names})" if suggestion else names


def suggest_name(name: str, known: Collection[str]) -> str:
    """Return the known name closest to a wrong one as a question, whatever the case of
    its letters; empty if none is close."""
    by_lower_case = {known_name.lower(): known_name for known_name in known}
    close = difflib.get_close_matches(str(name).lower(), by_lower_case, n=1)
    return f"{by_lower_case[close[0]]!r}?" if close else ""


def format_printable(text: str) -> str:
    """Return a text on one line, with control characters as escapes."""
    return escape_control_characters(" ".join(text.split()))


def escape_control_characters(text: str) -> str:
    """Return a text with what `find_control_character` finds as escapes, because a
    file's contents must not control a terminal."""
    if text.isprintable():
        return text
    return "".join(
        ascii(character)[1:-1] if find_control_character(character) else character
        for character in text
    )


def find_control_character(text: str) -> str:
    """Return the first control character of a text, or the first mark that is invisible
    or changes the direction of writing; empty if there is none."""
    if text.isprintable():
        return ""
    for character in text:
        is_space = unicodedata.category(character) == "Zs"
        if not character.isprintable() and not is_space:
            return character
    return ""


def find_text_fault(text: str) -> tuple[str, str] | None:
    """Return what is wrong with a text that reports, tables and terminals show, and
    what is allowed; None if nothing is wrong."""
    if character := find_control_character(text):
        found = f"the character {character!a} in {text!r}"
        return found, "printable characters on one line"
    if text.startswith(_FORMULA):
        allowed = (
            f"a text that does not begin with {text[0]}, which a spreadsheet takes for "
            "a formula"
        )
        return repr(text), allowed
    return None


def describe_system_fault(
    error: OSError | MemoryError | ImportError, place: str = "disk"
) -> InputError:
    """Return the InputError of a full disk, a folder that cannot be written to, used up
    memory and the like; `place` is named if the error names no file."""
    lacks_memory = any(message in str(error) for message in _NO_MEMORY)
    if isinstance(error, MemoryError) or lacks_memory:
        allowed = "a smaller file, more memory, or fewer jobs at a time (-j1)"
        return InputError("memory", "", "none left", allowed)
    if isinstance(error, ImportError):
        allowed = "an environment with every package of this version"
        missing = describe_missing_package(error)
        return missing or InputError("Python", "", str(error), allowed)
    # Name the file that was asked for, not the temporary name of an atomic write.
    path = _PARTIAL.sub("", str(error.filename or place))
    return InputError(path, "", describe_os_error(error), _USABLE)


def describe_missing_package(error: ImportError) -> InputError | None:
    """Return the InputError that names the extra of a package that is not installed;
    None if the package belongs to no extra."""
    package = (error.name or "").partition(".")[0]
    if package not in EXTRAS:
        return None
    # No package index has this project, so the extra comes from a clone.
    allowed = (
        "an environment with it: in the clone of elastocal,"
        f" python -m pip install -e '.[{EXTRAS[package]}]'"
    )
    return InputError("Python", "", f"no package {package}", allowed)


@contextmanager
def explain_missing_packages() -> Iterator[None]:
    """Raise an InputError if a package of an extra is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        explained = describe_missing_package(error)
        if explained is None:
            raise
        raise explained from error


def describe_os_error(error: OSError) -> str:
    """Return why something could not be read or written, in words that fit a
    sentence."""
    if error.errno == errno.ENOENT:
        return "no such file"
    return error.strerror or str(error)


def _shorten(text: str, longest: int) -> str:
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
