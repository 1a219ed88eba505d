"""`elastocal diagnose`: the Snakemake target of a campaign, with its progress, verdict and report."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from elastocal.command.pipeline import pipeline, workplace
from elastocal.command.printed import print_lines
from elastocal.command.quantities import MOST_JOBS
from elastocal.errors import InputError, steering

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

_NOTHING = "Nothing to be done"
# Snakemake prints it before its logger begins.
_NO_NEWS = "Using workflow specific profile"


def diagnose(
    folder: Annotated[Path, Argument(help="Folder of the campaign.")],
    cores: Annotated[int, Option("--cores", "-j", min=1, max=MOST_JOBS, help="Jobs that run at a time.")] = 2,
) -> None:
    """Find which effects the robot's model lacks; write the report.

    The report compares the error before and after on held-out poses. It is the Snakemake target `diagnose` of this campaign.
    """
    from rich.console import Console

    campaign = str(folder.resolve())
    # Braces are wildcards to Snakemake, the others mapping and comment of YAML.
    if mark := next((mark for mark in ("{", "}", ": ", " #") if mark in campaign), steering(campaign)):
        raise InputError(folder, "", repr(mark), "a path without it, which Snakemake does not take for a path")
    place, snakefile = workplace(), pipeline() / "Snakefile"
    words = ["-m", "snakemake", f"-j{cores}", "diagnose", "--config", f"campaign={campaign}"]
    # What is installed beside the package runs in the working directory.
    words += [] if snakefile.parent == place else ["--snakefile", str(snakefile)]
    with subprocess.Popen(
        [sys.executable, *words], cwd=place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as run:
        current = follow(run.stdout or (), Console(stderr=True))
    if current and not run.returncode:
        print_lines(_outcome(folder, place), Console(stderr=True))
    raise typer.Exit(run.returncode)


def follow(lines: Iterable[str], console: Console) -> bool:
    """Show the lines of a run as they come; returns whether there was nothing to do, where Snakemake prints no outcome."""
    current = False
    for line in map(str.rstrip, lines):
        current = current or line.startswith(_NOTHING)
        if not line.startswith(_NO_NEWS):
            print_lines([line], console)
    return current


def _outcome(folder: Path, place: Path) -> list[str]:
    from elastocal.campaigns.reading import read_descriptions
    from elastocal.report.outcome import outcome

    document, _ = read_descriptions(folder, pipeline() / "config" / "robots")
    return outcome([f"reports/loop/{document['campaign']}/report.pdf"], place)
