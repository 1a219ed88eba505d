"""What `snakemake` prints while it works: one line a job, and last of all why a job failed. The profile chooses it.

Snakemake finds the module by its name. A dry run prints how many jobs of each rule would run; with `-p` or `--verbose` all
that Snakemake prints by itself, which its log file has too.
"""

from __future__ import annotations

import sys
from logging import WARNING
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, cast

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from elastocal.counting import counted

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from logging import LogRecord

    class _Record(LogRecord):
        """What Snakemake's records say beside their message, each kind of event some of it."""

        stats: Mapping[str, int]
        rule_name: str
        wildcards: Mapping[str, str]
        log: Sequence[str]


# Beginnings of lines that are no news.
_NO_NEWS = (
    "Building DAG of jobs",
    "Config file ",
    "Select jobs to execute",
    "Execute ",
    "Assuming unrestricted shared filesystem",
    "Using shell",
    "Provided cores",
    "Rules claiming more threads",
)
_LOCKED = "Directory cannot be locked"
_NOTHING = "Nothing to be done"
_FAILED = "At least one job did not complete successfully."


class LogHandler(LogHandlerBase):
    """One line for each job that starts; of a job that failed, the last line of its log after all else."""

    def __post_init__(self) -> None:
        self._started = 0
        self._total = 0
        self._failed: list[tuple[str, list[str]]] = []

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def emit(self, record: LogRecord) -> None:
        """Write a record."""
        for line in self._lines(cast("_Record", record)):
            print(line, file=sys.stdout if self.common_settings.stdout else sys.stderr, flush=True)

    def _lines(self, record: _Record) -> list[str]:
        event = getattr(record, "event", None)
        dry, all_of_it = self.common_settings.dryrun, self.common_settings.verbose or self.common_settings.printshellcmds
        if self.common_settings.verbose or (dry and all_of_it):
            return [self.format(record)]
        if dry and event == LogEvent.RUN_INFO:
            # Snakemake gives the counts at the beginning and at the end.
            lines = [] if self._total else _counts(record.stats)
            self._total = record.stats["total"]
            return lines
        if dry and event != LogEvent.ERROR:
            # Reasons why jobs would run name every rule and file a second time.
            return [self.format(record)] if record.levelno >= WARNING or _NOTHING in record.getMessage() else []
        if event == LogEvent.RUN_INFO:
            self._total = record.stats.get("total", 0)
            return [counted(self._total, "job")]
        if event == LogEvent.JOB_INFO:
            self._started += 1
            return [f"{self._started} of {self._total}: {' '.join([record.rule_name, *map(str, record.wildcards.values())])}"]
        if event == LogEvent.JOB_ERROR:
            self._failed.append((record.rule_name, list(record.log)))
            return [f"failed: {record.rule_name}"]
        if event == LogEvent.ERROR and self._failed and _FAILED in record.getMessage():
            return [_reason(rule, logs) for rule, logs in self._failed]
        if _LOCKED in record.getMessage():
            # Locks of runs that were killed are taken away before (workflow/rules/one_run.py).
            return ["snakemake: found another run at work on the same files; allowed: the same command once that one has ended"]
        if event == LogEvent.ERROR and "CalledProcessError" in record.getMessage():
            # The output of the job itself stands above, and why it failed below.
            return []
        if event in (LogEvent.JOB_STARTED, LogEvent.JOB_FINISHED, LogEvent.PROGRESS, LogEvent.WORKFLOW_STARTED):
            return []
        return [] if str(record.msg).startswith(_NO_NEWS) else [self.format(record)]


def _counts(stats: Mapping[str, int]) -> list[str]:
    """How many jobs a run has, and of which rules, those with the most jobs first."""
    rules = sorted((rule for rule in stats if rule != "total"), key=lambda rule: -stats[rule])
    listed = fill(", ".join(f"{stats[rule]} {rule}" for rule in rules), 80, initial_indent="  ", subsequent_indent="  ")
    return [
        f"{counted(stats['total'], 'job')} would run:",
        listed,
        "Nothing was run. `snakemake -n -p` lists every job with its files.",
    ]


def _reason(rule: str, logs: Sequence[str]) -> str:
    """Last line of the logs of a job that failed; one that was killed as it began, or for want of memory, has none."""
    lines = [line for log in logs if Path(log).is_file() for line in Path(log).read_text(encoding="utf-8").splitlines()]
    found = f"{rule}: found an end before its log began ({', '.join(logs)})"
    otherwise = f"{found}; allowed: memory that a script needs to start and to end, and a sound one (if it said why, above)"
    return next((line for line in reversed(lines) if line.strip()), otherwise)
