"""Measured data of other people: where they are, what their contents must be, how to get them."""

import hashlib
import logging
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from elastocal.errors import InputError

# Of the sources here the largest has four megabytes.
LARGEST_BYTES = 200_000_000
# Names a folder that already has the files, for machines without a network.
FOLDER_VARIABLE = "ELASTOCAL_DATA"


@dataclass(frozen=True)
class PublicFile:
    """One file of a public repository.

    `repository`: owner/name on GitHub. `path`: in the repository. `local`: where the file stands below a folder that has it.
    `excerpt`: a part of it, which comes with this project and cannot be downloaded.
    """

    repository: str
    commit: str
    path: str
    sha256: str
    local: str
    licence: str
    excerpt: bool = False

    @property
    def address(self) -> str:
        """Where the file is downloaded from; the commit fixes its contents."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{self.path}"


def find_missing(names: Iterable[str], files: Mapping[str, PublicFile], kept: str | Path, box: str | Path) -> str | None:
    """What of some files is missing where `FOLDER_VARIABLE` stands for a network.

    `files`, `box`: as in `fetch`. `kept`: folder of what was downloaded before. Returns the first file that is missing, below
    the folder of `FOLDER_VARIABLE`; None where all are there, or may be downloaded.
    """
    for name in names if os.environ.get(FOLDER_VARIABLE) else ():
        if _at_hand(files[name], box) is None and not (Path(kept) / _name_copy(name, files[name])).is_file():
            return files[name].local
    return None


def _at_hand(file: PublicFile, box: str | Path) -> Path | None:
    """The file in the project's own folder, else in that of `FOLDER_VARIABLE`."""
    folders = [box, *filter(None, [os.environ.get(FOLDER_VARIABLE)])]
    return next((path for folder in folders if (path := Path(folder) / file.local).is_file()), None)


def _name_copy(name: str, file: PublicFile) -> str:
    return f"{name}{Path(file.path).suffix}"


def fetch(name: str, files: Mapping[str, PublicFile], folder: str | Path, box: str | Path) -> Path:
    """A file of public data with the contents that this project knows: from `box` or `FOLDER_VARIABLE`, else downloaded once.

    `files`: those of the importer that reads it. `folder`: keeps what is downloaded. `box`: has what comes with this project.
    Raises `InputError`: an unknown name, a file of other contents, or no way to get it.
    """
    if name not in files:
        raise InputError("public data", "", repr(name), ", ".join(files))
    file = files[name]
    if local := _at_hand(file, box):
        found = hashlib.sha256(local.read_bytes()).hexdigest()
        if found != file.sha256:
            origin = "an excerpt of" if file.excerpt else "as in"
            raise InputError(local, "", f"SHA-256 {found}", f"{file.sha256}, {origin} {file.address}")
        return local
    if file.excerpt:
        raise InputError(Path(box) / file.local, "", "no such file", "the one that comes with this project")
    # Loads what asks a network, which the rules, who look for files alone, do without.
    import pooch

    pooch.get_logger().setLevel(logging.ERROR)
    try:
        kept = pooch.retrieve(file.address, f"sha256:{file.sha256}", _name_copy(name, file), folder)
    except ValueError as error:
        raise InputError(file.address, "", f"other contents ({error})", f"SHA-256 {file.sha256}") from None
    except OSError as error:
        allowed = f"a network, or the folder in {FOLDER_VARIABLE} with {file.local}"
        raise InputError(file.address, "", f"no download ({error})", allowed) from None
    return Path(kept)
