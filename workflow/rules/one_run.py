"""What a run leaves behind that was killed, and whether the disk can be written to:
seen to before Snakemake starts any job."""

import fcntl
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import IO

from elastocal.errors import InputError
from elastocal.io.atomic_writes import check_folder, remove_partials

# Of each run under way, and of each job (workflow/scripts/job.py); the system gives
# them back whatever ends the process.
RUNS = "runs.lock"
JOBS = "jobs.lock"


def begin(snakemake_folder: Path, written: list[str]) -> IO[str]:
    """Take away the locks of a run that was killed and what it was writing, once its
    jobs have ended.

    `snakemake_folder`: Snakemake's own, of the working directory. `written`: folders
    that jobs write to. Returns to be kept open while the run lasts. Raises
    `InputError`: a folder that cannot be written to or that holds something else than
    files and folders, or a full disk.
    """
    for folder in (*written, snakemake_folder.as_posix()):
        try:
            os.makedirs(folder, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(bytes(65536))
        except OSError as error:
            allowed = "a folder with space where this user may write; the same command goes on then"
            raise InputError(
                folder, "", error.strerror or str(error), allowed
            ) from None
        check_folder(folder)
    run = open(snakemake_folder / RUNS, "a")  # noqa: SIM115
    if _alone(run):
        with open(snakemake_folder / JOBS, "a") as jobs:
            if not _alone(jobs):
                print(
                    "an earlier run was killed: waiting for the jobs that it left behind",
                    flush=True,
                )
            fcntl.flock(jobs, fcntl.LOCK_EX)
        for folder in written:
            remove_partials(folder)
        # Snakemake's locks hold names of files and not whose they are.
        for lock in (snakemake_folder / "locks").glob("*.lock"):
            with suppress(FileNotFoundError):
                lock.unlink()
    # Another run may work beside this one where they make different files; Snakemake's
    # locks are for that.
    fcntl.flock(run, fcntl.LOCK_SH)
    return run


def _alone(file: IO[str]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
