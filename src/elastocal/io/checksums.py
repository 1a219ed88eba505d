"""Checksums of what the steps wrote, beside the results, so that whoever reads a file next finds a byte that was altered.

Each record is a line of ``sha256sum``, whose option ``--check`` reads it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_text

if TYPE_CHECKING:
    from collections.abc import Iterable

RECORDS = Path("results/checksums")
# Folders of what the pipeline makes; the rest is the user's.
_MADE = ("data", "results", "reports")


def record_checksums(paths: Iterable[str]) -> None:
    """Keep the checksum of each file that a step has written.

    Parameters
    ----------
    paths : iterable of str
        Files or folders, relative to the working directory; what does not lie in data, results or reports is left out.
    """
    for path in filter(_made, paths):
        place = _record_of(path)
        place.parent.mkdir(parents=True, exist_ok=True)
        write_text(place, f"{checksum(path)}  {path}\n")


def check_checksums(paths: Iterable[str]) -> None:
    """Refuse files that are no longer what the step wrote that made them.

    Parameters
    ----------
    paths : iterable of str
        As in `record_checksums`; of files without a record nothing is known.

    Raises
    ------
    InputError
        The first such file.
    """
    for path in filter(_made, paths):
        place = _record_of(path)
        if place.is_file() and Path(path).exists() and place.read_text("utf-8").split(" ")[0] != checksum(path):
            allowed = "the file as the pipeline wrote it (delete it and it is made again)"
            raise InputError(path, "", "other contents than were written", allowed)


def checksum(path: str | Path) -> str:
    """SHA-256 of a file, or of the names and checksums of all files below a folder.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    str
    """
    if Path(path).is_dir():
        files = sorted(file for file in Path(path).rglob("*") if file.is_file())
        listed = "".join(f"{checksum(file)}  {file.relative_to(path).as_posix()}\n" for file in files)
        return hashlib.sha256(listed.encode()).hexdigest()
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _made(path: str) -> bool:
    return Path(path).parts[:1] in [(name,) for name in _MADE] and ".." not in Path(path).parts


def _record_of(path: str) -> Path:
    return RECORDS / f"{path}.sha256"
