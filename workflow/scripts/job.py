"""Run the step of a script with a log, checked inputs, a record and one-line errors."""

import fcntl
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from import_log import write_log

from elastocal.errors import InputError, describe_system_fault
from elastocal.io.origin import SOURCE_FILES, Origin, list_versions
from elastocal.io.records import JobRecord, digest_inputs, write_records

# Folder of the Snakefile. Snakemake runs a copy of a script under the name of the file.
TOP = Path(__file__).resolve().parents[2]
# Running jobs share this lock. A run that begins after another one was killed waits for
# the jobs of that run.
JOBS_LOCK = Path(".snakemake/jobs.lock")


class Job(Protocol):
    """The object that Snakemake gives to a script; its entries are named by the rule."""

    input: Any
    output: Any
    params: Any
    wildcards: Any
    log: Any
    rule: str
    config: Any


def run(
    step: Callable[[Job], None], snakemake: Job, *, check_inputs: bool = True
) -> None:
    """Run a step as a job: check its inputs, call it, and record what it has written.

    An `InputError` or a fault of the machine ends the job with one line in its log.

    Parameters
    ----------
    step : callable
        The work of the job.
    snakemake : Job
        The object that Snakemake gives to the script.
    check_inputs : bool, optional
        Whether the inputs must be unchanged since a job wrote them, and have its
        record.
    """
    log = snakemake.log[0]
    sys.excepthook = sys.__excepthook__
    write_log(log, "")
    try:
        with _shared_lock():
            started = _now()
            sources = snakemake.params.get(SOURCE_FILES, ())
            digests, unrecorded = digest_inputs(
                [*snakemake.input, *sources], None if check_inputs else sources
            )
            step(snakemake)
            write_records(_build_record(snakemake, started, digests, unrecorded))
    except InputError as error:
        write_log(log, f"{error}\n")
        # The logger prints the last line of the log when the run ends, so the job itself
        # stays silent and the reason is given once.
        sys.exit(1)
    except (OSError, MemoryError) as error:
        # Errors of pyarrow do not name the file.
        file = next(iter(snakemake.output), "disk")
        fault = describe_system_fault(error, file)
        line = f"{fault}; the same command goes on then"
        write_log(log, f"{traceback.format_exc()}{line}\n")
        sys.exit(line)
    except BaseException:
        write_log(log, traceback.format_exc())
        raise
    write_log(log, "done\n")


def origin_of(job: Job) -> Origin:
    """Return commit, configuration and seed of the run that a job belongs to."""
    return Origin(**job.config["origin"])


@contextmanager
def _shared_lock() -> Iterator[None]:
    """Hold the lock that tells a later run that this job is still at work."""
    if not JOBS_LOCK.parent.is_dir():
        yield
        return
    # The system releases the lock however the process ends.
    with open(JOBS_LOCK, "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        yield


def _build_record(
    job: Job, started: str, inputs: dict[str, str], unrecorded: tuple[str, ...]
) -> JobRecord:
    return JobRecord(
        job.rule,
        {name: str(value) for name, value in job.wildcards.items()},
        started,
        _now(),
        inputs,
        unrecorded,
        tuple(map(str, job.output)),
        origin_of(job),
        list_versions(TOP),
    )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
