"""What every script does around its one call: a log, checked inputs, and one line where
the input is at fault."""

import fcntl
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from import_log import write_log

from elastocal.errors import InputError, describe_system_fault
from elastocal.io.origin import Origin, list_versions
from elastocal.io.records import JobRecord, digest_inputs, write_records

# With the Snakefile; the name of this file goes by the folder of the rules.
TOP = Path(__file__).resolve().parents[2]
# Shared by the jobs under way: a run that begins after another one was killed waits for
# the jobs that this one left behind.
JOBS_LOCK = Path(".snakemake/jobs.lock")


class Job(Protocol):
    """What Snakemake hands to a script; the names in each part are the rule's."""

    input: Any
    output: Any
    params: Any
    wildcards: Any
    log: Any
    rule: str
    config: Any


def run(
    step: Callable[[Job], None], snakemake: Job, checked: Iterable[str] | None = None
) -> None:
    """Call ``step(snakemake)``; an `InputError` or a fault of the machine ends the job
    with one line.

    Files in `checked` that are no longer what a job wrote, or have no record of it, are
    refused before; all inputs where it is not given.
    """
    log = snakemake.log[0]
    sys.excepthook = sys.__excepthook__
    write_log(log, "")
    try:
        with _under_way():
            started = _now()
            digests, own = digest_inputs(
                snakemake.input, None if checked is None else set(map(str, checked))
            )
            step(snakemake)
            write_records(_record(snakemake, started, digests, own))
    except InputError as error:
        write_log(log, f"{error}\n")
        sys.exit(str(error))
    except (OSError, MemoryError) as error:
        # What pyarrow writes comes without a name.
        line = f"{describe_system_fault(error, next(iter(snakemake.output), 'disk'))}; the same command goes on then"
        write_log(log, f"{traceback.format_exc()}{line}\n")
        sys.exit(line)
    except BaseException:
        write_log(log, traceback.format_exc())
        raise
    write_log(log, "done\n")


def origin_of(job: Job) -> Origin:
    """Commit, configuration and seed of the run that this job belongs to."""
    return Origin(**job.config["origin"])


@contextmanager
def _under_way() -> Iterator[None]:
    if not JOBS_LOCK.parent.is_dir():
        yield
        return
    # The system gives the lock back whatever ends the process.
    with open(JOBS_LOCK, "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH)
        yield


def _record(
    job: Job, started: str, inputs: dict[str, str], own: tuple[str, ...]
) -> JobRecord:
    wildcards = {name: str(value) for name, value in job.wildcards.items()}
    outputs = tuple(map(str, job.output))
    return JobRecord(
        job.rule,
        wildcards,
        started,
        _now(),
        inputs,
        own,
        outputs,
        origin_of(job),
        list_versions(TOP),
    )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
