"""All use that the workflow makes of parts of Snakemake that are not its interface.

A new version of Snakemake may change these parts without notice. They are therefore
kept in this file, `tests/workflow/test_snakemake_internals.py` has a test for each, and
`pyproject.toml` bounds the version of Snakemake from above.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from snakemake.benchmark import benchmarked
from snakemake.executors.dryrun import Executor as DryRunExecutor
from snakemake.io import _IOFile
from snakemake.iocontainers import Wildcards
from snakemake.script import PythonScript

if TYPE_CHECKING:
    from warm_start import StartedScript

# Number of jobs a second from which a limit on their starts has no effect here, because
# cores or a cluster limit them first.
UNREACHABLE_JOBS_PER_SECOND = 100


def replace_script_runner(start_script: Callable[[str], StartedScript]) -> None:
    """Let a function of ours start the scripts of rules instead of a new interpreter.

    Snakemake prepares the script, measures its process and treats a failure as before.

    Parameters
    ----------
    start_script : callable
        Starts a script by its file name. It raises `OSError` if it cannot; Snakemake
        then starts the script itself.
    """
    start_interpreter = PythonScript.execute_script

    def execute_script(script: Any, name: str, edit: bool = False) -> None:  # noqa: FBT001, FBT002 - Snakemake's signature
        try:
            started = start_script(name)
        except OSError:
            start_interpreter(script, name, edit)
            return
        with benchmarked(started.process or False, script.bench_record):
            exit_code = started.wait()
        if exit_code:
            raise subprocess.CalledProcessError(exit_code, name)

    PythonScript.execute_script = execute_script


def remember_checksums() -> None:
    """Compute the checksum of a file once while the file stays as it is.

    After a job has ended Snakemake computes the checksums of all its inputs again for
    each of its outputs.
    """
    compute_checksum = _IOFile.checksum
    checksums: dict[tuple[Any, ...], Any] = {}

    async def checksum(file: Any, *arguments: Any, **settings: Any) -> Any:
        status = os.stat(file) if os.path.exists(file) else None
        version = status and (status.st_ino, status.st_mtime_ns, status.st_size)
        key = (str(file), version, arguments, *settings.items())
        if key not in checksums:
            checksums[key] = await compute_checksum(file, *arguments, **settings)
        return checksums[key]

    _IOFile.checksum = checksum


def check_scripts_once() -> None:
    """Check once for each rule that its script exists.

    Snakemake reads the script of each job, although a script whose name has no
    wildcards is the same for all jobs of a rule.
    """
    # Modules of Snakemake import one another, and this one cannot be the first.
    from snakemake.dag import ScriptProcessor

    check_script = ScriptProcessor.process_job
    checked: set[tuple[str, str]] = set()

    def process_job(processor: Any, job: Any) -> None:
        script = getattr(job.rule, processor.script_type)
        key = (processor.script_type, job.rule.name)
        if key in checked and "{" not in str(script):
            return
        check_script(processor, job)
        checked.add(key)

    ScriptProcessor.process_job = process_job


def skip_unprinted_messages(workflow: Any, logger: str) -> None:
    """Format no messages about jobs in a dry run whose logger does not print them.

    Parameters
    ----------
    workflow : Workflow
    logger : str
        Name of the logger that prints jobs only with `-p` or `--verbose`.
    """
    settings = workflow.output_settings
    prints_jobs = settings.printshellcmds or settings.verbose
    if prints_jobs or logger not in settings.log_handler_settings:
        return
    DryRunExecutor.printjob = lambda executor, job: None


def lift_rate_limit(workflow: Any) -> None:
    """Remove a limit on the number of jobs a second that no machine of ours reaches.

    While Snakemake limits how many jobs start in a time span, and by default it does,
    each search for ready jobs starts a timer for another search, and each job adds one
    more for the rest of the run.
    """
    limit = workflow.scheduling_settings.max_jobs_per_timespan
    if limit is None:
        return
    if limit.max_jobs >= UNREACHABLE_JOBS_PER_SECOND * limit.timespan:
        workflow.scheduler.job_rate_limiter = None


def runs_no_job(rule: Any) -> bool:
    """Whether a rule only collects the files of other rules."""
    return rule.norun


def set_log_and_benchmark(rule: Any, log: str, benchmark: str) -> None:
    """Set the log and the benchmark file of a rule that names none."""
    # Without these modifiers Snakemake refuses inputs and logs that are set after a
    # rule has been read; those of an output have the same meaning.
    rule.log_modifier = rule.benchmark_modifier = rule.output_modifier
    rule.input_modifier = rule.output_modifier
    if not rule.log:
        rule.set_log(log)
    if not rule.benchmark:
        rule.benchmark = benchmark


def find_producer(rules: Iterable[Any], path: str) -> Any | None:
    """Return the first rule that makes a file, or None."""
    return next((rule for rule in rules if rule.is_producer(path)), None)


def expand_files(rule: Any, path: str) -> tuple[list[str], list[str]]:
    """Return the inputs and the outputs of the job of a rule that makes a file."""
    wildcards = Wildcards(fromdict=rule.get_wildcards(path))
    inputs = [str(file) for file in rule.expand_input(wildcards)[0]]
    outputs = [str(file) for file in rule.expand_output(wildcards)[0]]
    return inputs, outputs


def files_of_jobs(workflow: Any) -> list[str]:
    """Return the files that the jobs of a finished run have made."""
    return [file for job in workflow.dag.jobs for file in job.output]


def name_of_script(rule: Any) -> str:
    """Return the file name of the script of a rule."""
    return Path(rule.script).name


def runs_jobs_here(workflow: Any) -> bool:
    """Whether the jobs run on this machine, and not on a cluster."""
    return workflow.local_exec


def is_starting_run(workflow: Any) -> bool:
    """Whether this process runs jobs: it is no job itself, and no dry run."""
    return workflow.is_main_process and not workflow.dryrun


def config_arguments(workflow: Any) -> list[str]:
    """Return the entries of `--config`, each `key=value`."""
    return list(workflow.config_settings.config_args or ())


def config_files(workflow: Any) -> list[Path]:
    """Return the files of `--configfile`."""
    return list(workflow.config_settings.configfiles or ())
