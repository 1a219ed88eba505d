"""Print what `snakemake` does: one line for each job, and at the end why a job failed.

The profile chooses this logger; Snakemake finds the module by its name. A dry run
prints what Snakemake prints by itself, without the list of all jobs unless `-p` asks
for it. `--verbose` prints everything.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from elastocal.counting import format_count

if TYPE_CHECKING:
    from collections.abc import Sequence

# Events that list jobs in a dry run.
_JOB_EVENTS = (LogEvent.JOB_INFO, LogEvent.SHELLCMD)
# Events and messages that this logger does not print.
_SILENT_EVENTS = (
    LogEvent.JOB_STARTED,
    LogEvent.JOB_FINISHED,
    LogEvent.PROGRESS,
    LogEvent.WORKFLOW_STARTED,
)
_SILENT_MESSAGES = (
    "Building DAG of jobs",
    "Config file ",
    "Select jobs to execute",
    "Execute ",
    "Using shell",
    "Provided cores",
    "Assuming unrestricted shared filesystem",
    "Rules claiming more threads",
)
_LOCKED = "Directory cannot be locked"
_FAILED = "At least one job did not complete successfully."
# What a successful job writes to its log at its end (workflow/scripts/job.py).
_DONE = "done"
# Locks of killed runs are removed before (workflow/rules/one_run.py), so that a lock
# belongs to a run at work.
_LOCKED_BY_ANOTHER_RUN = (
    "snakemake: found another run at work on the same files; allowed: the same command "
    "once that one has ended"
)


class LogHandler(LogHandlerBase):
    """Print one line for each job that starts, and at the end the last line of the log
    of each job that failed."""

    def __post_init__(self) -> None:
        self._started = 0
        self._total = 0
        self._failed: list[tuple[str, Sequence[str]]] = []

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def emit(self, record: Any) -> None:
        """Print the message of a record if it has one."""
        if self.common_settings.dryrun or self.common_settings.verbose:
            lines = self._lines_of_snakemake(record)
        else:
            lines = self._lines_of_event(record)
        stream = sys.stdout if self.common_settings.stdout else sys.stderr
        for line in lines:
            print(line, file=stream, flush=True)

    def _lines_of_snakemake(self, record: Any) -> list[str]:
        """Return what Snakemake prints by itself, without jobs that are not asked
        for."""
        settings = self.common_settings
        lists_jobs = settings.verbose or settings.printshellcmds
        if getattr(record, "event", None) in _JOB_EVENTS and not lists_jobs:
            return []
        return [self.format(record)]

    def _lines_of_event(self, record: Any) -> list[str]:
        """Return the lines of an event, and keep what later lines need: the number of
        jobs, and those that failed."""
        event = getattr(record, "event", None)
        if event == LogEvent.RUN_INFO:
            self._total = record.stats.get("total", 0)
            return [format_count(self._total, "job")]
        if event == LogEvent.JOB_INFO:
            self._started += 1
            job = " ".join([record.rule_name, *map(str, record.wildcards.values())])
            return [f"{self._started} of {self._total}: {job}"]
        if event == LogEvent.JOB_ERROR:
            self._failed.append((record.rule_name, record.log))
            return [f"failed: {record.rule_name}"]
        return self._lines_of_message(record, is_error=event == LogEvent.ERROR)

    def _lines_of_message(self, record: Any, *, is_error: bool) -> list[str]:
        """Return the lines of a message that is about no single job."""
        message = record.getMessage()
        if is_error and self._failed and _FAILED in message:
            return [_describe_failure(rule, logs) for rule, logs in self._failed]
        if _LOCKED in message:
            return [_LOCKED_BY_ANOTHER_RUN]
        # The job has printed its own output before, and why it failed follows.
        is_known = is_error and "CalledProcessError" in message
        is_silent = getattr(record, "event", None) in _SILENT_EVENTS
        if is_known or is_silent or str(record.msg).startswith(_SILENT_MESSAGES):
            return []
        return [self.format(record)]


def _describe_failure(rule: str, logs: Sequence[str]) -> str:
    """Return the last line of the logs of a failed job.

    A job that was killed before it wrote a line probably lacked memory. The log that it
    leaves is empty, or that of an earlier run, which was successful.
    """
    last_line = ""
    for log in logs:
        if Path(log).is_file():
            for line in Path(log).read_text(encoding="utf-8").splitlines():
                if line.strip():
                    last_line = line
    if last_line not in ("", _DONE):
        return last_line
    return (
        f"{rule}: found that the job was killed before it wrote its log "
        f"({', '.join(logs)}); allowed: enough memory for the job "
        "(if the job said why it ended, its message is above)"
    )
