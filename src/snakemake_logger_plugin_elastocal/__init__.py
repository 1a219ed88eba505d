"""What `snakemake` prints while it works: one line a job, and last of all why a job
failed. The profile chooses it.

Snakemake finds the module by its name. A dry run prints what Snakemake prints by
itself, without a list of all jobs unless `-p` asks for it; `--verbose` prints
everything.
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

_OF_EACH_JOB = (LogEvent.JOB_INFO, LogEvent.SHELLCMD)
# Events and beginnings of lines that are no news.
_SILENT = (
    LogEvent.JOB_STARTED,
    LogEvent.JOB_FINISHED,
    LogEvent.PROGRESS,
    LogEvent.WORKFLOW_STARTED,
)
_NO_NEWS = (
    *(
        "Building DAG of jobs",
        "Config file ",
        "Select jobs to execute",
        "Execute ",
        "Using shell",
        "Provided cores",
    ),
    *("Assuming unrestricted shared filesystem", "Rules claiming more threads"),
)
_LOCKED = "Directory cannot be locked"
_FAILED = "At least one job did not complete successfully."
# Locks of runs that were killed are taken away before (workflow/rules/one_run.py).
_TWICE = "snakemake: found another run at work on the same files; allowed: the same command once that one has ended"


class LogHandler(LogHandlerBase):
    """One line for each job that starts; of a job that failed, the last line of its log
    after all else."""

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
        """Write a record."""
        for line in self._lines(record):
            print(
                line,
                file=sys.stdout if self.common_settings.stdout else sys.stderr,
                flush=True,
            )

    def _lines(self, record: Any) -> list[str]:
        event = getattr(record, "event", None)
        message = record.getMessage()
        asked = self.common_settings
        if asked.dryrun or asked.verbose:
            unasked = event in _OF_EACH_JOB and not (
                asked.verbose or asked.printshellcmds
            )
            return [] if unasked else [self.format(record)]
        if event == LogEvent.RUN_INFO:
            self._total = record.stats.get("total", 0)
            return [format_count(self._total, "job")]
        if event == LogEvent.JOB_INFO:
            self._started += 1
            return [
                f"{self._started} of {self._total}: {' '.join([record.rule_name, *map(str, record.wildcards.values())])}"
            ]
        if event == LogEvent.JOB_ERROR:
            self._failed.append((record.rule_name, record.log))
            return [f"failed: {record.rule_name}"]
        if event == LogEvent.ERROR and self._failed and _FAILED in message:
            return [_reason(rule, logs) for rule, logs in self._failed]
        if _LOCKED in message:
            return [_TWICE]
        # The output of the job itself stands above, and why it failed below.
        known = event == LogEvent.ERROR and "CalledProcessError" in message
        return (
            []
            if known or event in _SILENT or str(record.msg).startswith(_NO_NEWS)
            else [self.format(record)]
        )


def _reason(rule: str, logs: Sequence[str]) -> str:
    """Last line of the logs of a job that failed; one that was killed as it began, or
    for want of memory, has none."""
    lines = [
        line
        for log in logs
        if Path(log).is_file()
        for line in Path(log).read_text(encoding="utf-8").splitlines()
    ]
    found = f"{rule}: found an end before its log began ({', '.join(logs)})"
    otherwise = f"{found}; allowed: memory that a script needs to start and to end, and a sound one (if it said why, above)"
    return next((line for line in reversed(lines) if line.strip()), otherwise)
