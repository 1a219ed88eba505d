"""Clean up after a killed run, and check that the disk can be written to.

Both happen before Snakemake starts a job.
"""

import fcntl
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import IO

from elastocal.errors import InputError
from elastocal.io.atomic_writes import check_folder, remove_partials

# Each run holds the first lock, and each of its jobs the second one
# (workflow/scripts/job.py). The system releases them however the process ends.
RUNS = "runs.lock"
JOBS = "jobs.lock"


def begin(snakemake_folder: Path, written: list[str]) -> IO[str]:
    """Remove the locks and partial files of a killed run once its jobs have ended.

    Parameters
    ----------
    snakemake_folder : Path
        Snakemake's own folder in the working directory.
    written : list of str
        Folders that jobs write to.

    Returns
    -------
    file
        The lock of this run; it must stay open while the run lasts.

    Raises
    ------
    InputError
        If a folder cannot be written to, contains anything but files and folders, or
        the disk is full.
    """
    for folder in (*written, snakemake_folder.as_posix()):
        _check_writable(folder)
        check_folder(folder)
    run = open(snakemake_folder / RUNS, "a")  # noqa: SIM115 - it stays open
    if _lock_alone(run):
        with open(snakemake_folder / JOBS, "a") as jobs:
            if not _lock_alone(jobs):
                print(
                    "an earlier run was killed: waiting for its jobs to end",
                    flush=True,
                )
            fcntl.flock(jobs, fcntl.LOCK_EX)
        for folder in written:
            remove_partials(folder)
        # Snakemake's locks name files, but not the run that holds them.
        for lock in (snakemake_folder / "locks").glob("*.lock"):
            with suppress(FileNotFoundError):
                lock.unlink()
    # Another run may work at the same time if it makes other files; Snakemake's own
    # locks ensure that.
    fcntl.flock(run, fcntl.LOCK_SH)
    return run


def _check_writable(folder: str) -> None:
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(65536))
    except OSError as error:
        raise InputError(
            folder,
            "",
            error.strerror or str(error),
            "a folder with space where this user may write;"
            " the same command goes on then",
        ) from None


def _lock_alone(file: IO[str]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
