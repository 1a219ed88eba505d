"""Checksums of what the steps wrote, beside the results, so that whoever reads a file next finds a byte that was altered.

Each record holds lines of ``sha256sum``, whose option ``--check`` reads them; one for each file where a step wrote a folder.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_text
from elastocal.io.texts import check_file

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
        write_text(place, "".join(f"{checksum(file)}  {file}\n" for file in files_of(path)))


def check_checksums(paths: Iterable[str], within: str | Path = "") -> None:
    """Refuse files that are no longer what the step wrote that made them.

    Parameters
    ----------
    paths : iterable of str
        As in `record_checksums`; of files without a record nothing is known.
    within : str or Path
        Folder that they and the records are in; the working directory without.

    Raises
    ------
    InputError
        The first such file.
    """
    for path in filter(_made, paths):
        place = Path(within, _record_of(path))
        if not place.is_file() or not Path(within, path).exists():
            continue
        lines = place.read_text("utf-8").splitlines()
        written = {file: digest for digest, _, file in (line.partition("  ") for line in lines)}
        found = {file: checksum(Path(within, file)) for file in files_of(path, within)}
        for file in sorted(written.keys() | found.keys()):
            if written.get(file) != found.get(file):
                again = "it" if file == path else path
                allowed = f"the file as the pipeline wrote it (delete {again} and it is made again)"
                raise InputError(Path(within, file), "", "other contents than were written", allowed)


def checksum(path: str | Path) -> str:
    """SHA-256 of a file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    str
    """
    check_file(path)
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def files_of(path: str, within: str | Path = "") -> list[str]:
    """The file, or all files below the folder but for hidden ones: Snakemake notes the time in one, after the step.

    Parameters
    ----------
    path : str
    within : str or Path
        Folder that `path` is in; the working directory without.

    Returns
    -------
    list of str
        Named as `path` is.
    """
    folder = Path(within, path)
    if not folder.is_dir():
        return [path]
    files = [file for file in folder.rglob("*") if file.is_file() and not file.name.startswith(".")]
    return sorted(file.relative_to(within).as_posix() for file in files)


def _made(path: str) -> bool:
    return Path(path).parts[:1] in [(name,) for name in _MADE] and ".." not in Path(path).parts


def _record_of(path: str) -> Path:
    return RECORDS / f"{path}.sha256"
