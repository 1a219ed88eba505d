"""Runs of the Snakemake target `diagnose`: its command line, and several campaigns side by
side, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import time
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING

from elastocal.command.terminal import (
    find_pipeline,
    find_robots_folder,
    find_workplace,
    print_lines,
)
from elastocal.errors import InputError, describe_system_fault

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from rich.console import Console

# Snakemake prints this line before its logger begins.
PROFILE_NOTICE = "Using workflow specific profile"
_HEADER = ("campaign", "verdict", "before, mm", "after, mm", "s")
_FAILED = "failed"


@dataclass(frozen=True)
class DiagnosisRun:
    """One campaign's run that has ended.

    Attributes
    ----------
    campaign : name of the campaign; the folder if its document cannot be read.
    fault : why the run failed; empty if it was successful.
    seconds : wall time.
    """

    campaign: str
    fault: str
    seconds: float


def build_run_command(folder: Path, cores: int, workplace: Path) -> list[str]:
    """Return the command line that diagnoses a campaign in a working directory.

    An InputError refuses a path that Snakemake would take for something else.
    """
    from elastocal.campaigns.campaign_folder import check_workflow_path

    campaign = str(folder.resolve())
    check_workflow_path(campaign)
    if find_spec("snakemake") is None:
        missing = ModuleNotFoundError(name="snakemake")
        raise describe_system_fault(missing)
    snakefile = find_pipeline() / "Snakefile"
    command = [sys.executable, "-m", "snakemake", f"-j{cores}", "diagnose"]
    command += ["--config", f"campaign={campaign}"]
    # An installed pipeline runs in the working directory.
    if snakefile.parent != workplace:
        command += ["--snakefile", str(snakefile)]
    return command


def diagnose_folders(
    folders: Sequence[Path], processes: int, console: Console
) -> list[DiagnosisRun]:
    """Diagnose campaigns side by side, one core each; a fault of one stops no other.

    Parameters
    ----------
    folders : sequence of Path
        Folders of the campaigns.
    processes : int
        Number of campaigns at a time.
    console : Console
        Gets the lines of all runs, each after the name of its campaign.

    Returns
    -------
    list of DiagnosisRun
        In the order of the folders.

    Raises
    ------
    InputError
        If two folders have campaigns of the same name, because the results of both
        would have the same place.
    """
    from concurrent.futures import ThreadPoolExecutor

    names = _name_campaigns(folders)
    running: set[subprocess.Popen[str]] = set()

    def diagnose_folder(name: str, folder: Path) -> DiagnosisRun:
        begun = time.monotonic()
        try:
            fault = _run_and_print(name, folder, running, console)
        except InputError as error:
            fault = str(error)
            print_lines([f"{name}: {fault}"], console)
        return DiagnosisRun(name, fault, time.monotonic() - begun)

    with ThreadPoolExecutor(processes) as pool:
        runs = [
            pool.submit(diagnose_folder, name, folder)
            for name, folder in zip(names, folders, strict=True)
        ]
        try:
            return [run.result() for run in runs]
        except BaseException:
            # An interrupt ends the runs at work and begins no other.
            pool.shutdown(wait=False, cancel_futures=True)
            for process in [*running]:
                process.terminate()
            raise


def _name_campaigns(folders: Sequence[Path]) -> list[str]:
    """Return the name of each campaign, or its folder if it has no readable document, a
    fault that its run reports."""
    from elastocal.campaigns.campaign_folder import read_campaign_folder

    names: dict[str, Path] = {}
    for folder in folders:
        try:
            name = read_campaign_folder(folder, find_robots_folder()).name
        except InputError:
            name = folder.as_posix()
        if name in names:
            finding = f"{name!r}, the campaign of {names[name]} too"
            raise InputError(folder, "campaign", finding, "a name of its own")
        names[name] = folder
    return [*names]


def _run_and_print(
    name: str, folder: Path, running: set[subprocess.Popen[str]], console: Console
) -> str:
    """Run the diagnosis of a campaign on one core; return why it failed, or nothing.

    The process is in `running` while it is at work.
    """
    workplace = find_workplace()
    last_line = ""
    with subprocess.Popen(
        build_run_command(folder, 1, workplace),
        cwd=workplace,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        running.add(process)
        for line in map(str.rstrip, process.stdout or ()):
            if line and not line.startswith(PROFILE_NOTICE):
                last_line = line.removeprefix(f"{name}: ")
                print_lines([f"{name}: {last_line}"], console)
    running.discard(process)
    if not process.returncode:
        return ""
    return last_line or f"exit code {process.returncode}"


def format_runs(runs: Iterable[DiagnosisRun]) -> list[str]:
    """Return a table with the verdict, the errors before and after on held-out poses (RMS)
    and the seconds of each run; below it, why runs failed."""
    import pandas as pd

    from elastocal.verdict import read_verdict

    rows = []
    faults = []
    for run in runs:
        cells = (_FAILED, "", "")
        if run.fault:
            faults.append(f"! {run.campaign}: {run.fault}")
        else:
            reports = find_workplace() / "reports" / "loop" / run.campaign
            verdict = read_verdict(reports / "verdict.json")
            errors = (verdict.heldout.before, verdict.heldout.delivered)
            before, after = (f"{1e3 * error.rms_m:.3f}" for error in errors)
            cells = (verdict.verdict, before, after)
        rows.append((run.campaign, *cells, f"{run.seconds:.0f}"))
    table = pd.DataFrame(rows, columns=[*_HEADER]).to_markdown(
        index=False,
        tablefmt="plain",
        colalign=("left", "left", "right", "right", "right"),
        disable_numparse=True,
    )
    return [*map(str.rstrip, table.splitlines()), *faults]
