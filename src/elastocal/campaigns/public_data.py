"""Measured data of other people: where they are, what their contents must be, how to get them. Never part of this project."""

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

    `repository`: owner/name on GitHub. `path`: in the repository. `local`: where the file stands below a folder that has all of
    them.
    """

    repository: str
    commit: str
    path: str
    sha256: str
    local: str
    licence: str

    @property
    def address(self) -> str:
        """Where the file is downloaded from; the commit fixes its contents."""
        return f"https://raw.githubusercontent.com/{self.repository}/{self.commit}/{self.path}"


def find_missing(names: Iterable[str], files: Mapping[str, PublicFile], kept: str | Path) -> str | None:
    """What of some files is missing where `FOLDER_VARIABLE` stands for a network.

    `files`: as in `fetch`. `kept`: folder of what was downloaded before. Returns the first file that is missing, below the
    folder of `FOLDER_VARIABLE`; None where all are there, or may be downloaded.
    """
    given = os.environ.get(FOLDER_VARIABLE)
    for name in names if given else ():
        if not (Path(given or "") / files[name].local).is_file() and not (Path(kept) / _name_copy(name, files[name])).is_file():
            return files[name].local
    return None


def _name_copy(name: str, file: PublicFile) -> str:
    return f"{name}{Path(file.path).suffix}"


def fetch(name: str, files: Mapping[str, PublicFile], folder: str | Path) -> Path:
    """A file of public data with the contents that this project knows: from `FOLDER_VARIABLE`, else downloaded once.

    `files`: those of the importer that reads it. `folder`: keeps what is downloaded. Raises `InputError`: an unknown name, a
    file of other contents, or no way to download it.
    """
    if name not in files:
        raise InputError("public data", "", repr(name), ", ".join(files))
    file = files[name]
    given = os.environ.get(FOLDER_VARIABLE)
    local = Path(given or "") / file.local
    if given and local.is_file():
        found = hashlib.sha256(local.read_bytes()).hexdigest()
        if found != file.sha256:
            raise InputError(local, "", f"SHA-256 {found}", f"{file.sha256}, as in {file.address}")
        return local
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
