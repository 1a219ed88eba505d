"""Refuse to replace a file that may be the only copy of somebody's work.

A command may replace what it has written itself, as long as nobody has changed it
since. For this it keeps a list of the files that it wrote, with their SHA-256. Every
other file that exists is the user's.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.errors import InputError
from elastocal.io.atomic_writes import check_places
from elastocal.io.json_files import read_json, write_json
from elastocal.io.records import compute_sha256

if TYPE_CHECKING:
    from collections.abc import Iterable

# The list of written files, in the folder of results/ and reports/.
WRITTEN_FILES = Path("results", "written_files.json")


def check_replaceable(
    outputs: Iterable[Path], inputs: Iterable[str | Path], top: Path, *, force: bool
) -> None:
    """Refuse outputs that would replace an input, or a file of the user.

    Parameters
    ----------
    outputs
        Files that the command is about to write or to remove.
    inputs
        Files that the command reads.
    top
        Folder of results/ and reports/.
    force
        Whether the user has allowed it.

    Raises
    ------
    InputError
        If an output exists, `force` is false, and the output is an input, or not as a
        command of elastocal has written it. Links, pipes and devices are refused in any
        case.
    """
    outputs = list(outputs)
    check_places(*outputs, top / WRITTEN_FILES)
    if force:
        return
    written = _read_written_files(top)
    existing_inputs = [path for path in map(Path, inputs) if path.exists()]
    for output in filter(Path.exists, outputs):
        if any(path.samefile(output) for path in existing_inputs):
            raise InputError(
                output,
                "",
                "a file that this command reads",
                "another --output; --force replaces it",
            )
        if written.get(_identify(output)) != compute_sha256(output):
            raise InputError(
                output,
                "",
                "a file that no command of elastocal has written, or that was changed"
                " since",
                "another --output; --force replaces it",
            )


def note_written_files(outputs: Iterable[Path], top: Path) -> None:
    """Add files that a command has written to the list, and remove those that are gone.

    If another command changes the list at the same time, an entry may be lost. The next
    command then asks for --force, and nothing else is lost.
    """
    written = _read_written_files(top) | {
        _identify(output): compute_sha256(output)
        for output in outputs
        if output.exists()
    }
    present = {path: digest for path, digest in written.items() if Path(path).exists()}
    path = top / WRITTEN_FILES
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, present)


def _identify(path: Path) -> str:
    """Return the absolute path of a file, without links on the way to it."""
    return os.path.realpath(path)


def _read_written_files(top: Path) -> dict[str, str]:
    """Read the list of written files; a list that cannot be read is taken as empty, so
    that every file counts as the user's."""
    path = top / WRITTEN_FILES
    if not path.is_file():
        return {}
    try:
        contents = read_json(path)
    except InputError:
        return {}
    return contents if isinstance(contents, dict) else {}
