"""Where the pipeline is that the command runs, with its robots and results."""

from __future__ import annotations

from pathlib import Path

from elastocal.errors import InputError

_MARK = "Snakefile"


def checkout() -> Path:
    """The folder with the Snakefile: the working directory or one above it, else the one that this package is installed from.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        Where there is none.
    """
    for folder in (Path.cwd(), *Path.cwd().parents, *Path(__file__).resolve().parents):
        if (folder / _MARK).is_file() and (folder / "workflow").is_dir():
            return folder
    raise InputError(Path.cwd(), "", "no Snakefile here or above", "a folder inside of a checkout of elastocal")
