"""A campaign's folder: `elastocal init` begins it, `check` says what it can show,
`diagnose` runs its Snakemake target."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from elastocal.command.terminal import (
    MOST_ROWS,
    pipeline,
    print_answer,
    print_lines,
    robots,
    workplace,
)
from elastocal.counting import format_count
from elastocal.errors import InputError, find_control_character

_ROBOT = "robot.yaml"
# Snakemake prints the second before its logger begins.
_NOTHING = "Nothing to be done"
_NO_NEWS = "Using workflow specific profile"


def init(
    folder: Annotated[
        Path,
        Argument(
            help="New folder, or one that has measurements or a robot file already."
        ),
    ],
    robot: Annotated[
        Path | None, Option(help="Robot file to copy there, where there is none.")
    ] = None,
) -> None:
    """Begin a campaign: campaign.yaml with every key explained.

    It has the targets of measurements that lie there; without any, measurements.csv is
    made to be filled in. No file that exists is replaced.
    """
    from rich.console import Console

    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV, PARQUET, read_measured_targets
    from elastocal.campaigns.reading import read_robot
    from elastocal.campaigns.writing import (
        format_campaign_template,
        format_sheet_header,
    )
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.documents import LARGEST_BYTES
    from elastocal.io.texts import read_text

    check_places(*(folder / name for name in (_ROBOT, DOCUMENT, CSV, PARQUET)))
    if (folder / DOCUMENT).exists():
        raise InputError(
            folder / DOCUMENT,
            "",
            "a campaign that is there already",
            "a folder without campaign.yaml",
        )
    if (folder / _ROBOT).exists() == (robot is not None):
        found = "a robot that is there already" if robot else "no robot file"
        raise InputError(
            folder / _ROBOT, "", found, "one robot file: there, or with --robot"
        )
    arm, (targets, measured) = (
        read_robot(robot or folder / _ROBOT),
        read_measured_targets(folder),
    )
    files = {} if robot is None else {_ROBOT: read_text(robot, LARGEST_BYTES)}
    if not (folder / CSV).exists() and not (folder / PARQUET).exists():
        files[CSV] = format_sheet_header(arm.joints)
    files[DOCUMENT] = format_campaign_template(
        folder.resolve().name, arm, targets, measured
    )
    with write_together(folder, files) as partial:
        for name, text in files.items():
            write_text(partial / name, text)
    first = (
        "check campaign.yaml for the frame and where targets sit"
        if targets
        else "fill in measurements.csv"
    )
    following = f"{first}, then elastocal check {folder.as_posix()}"
    print_answer(
        True, f"{folder.as_posix()}: {', '.join(files)}", [], following, Console()
    )


def check(folder: Annotated[Path, Argument(help="Folder of the campaign.")]) -> None:
    """Show what a campaign identifies and what looks suspicious.

    The exit code is 1 where the data are at fault and cannot be diagnosed.
    """
    from rich.console import Console

    from elastocal.loop.overview import overview

    found = overview(folder, robots())
    console = Console()
    answer = f"{found.campaign} cannot be diagnosed: the data are at fault"
    if found.diagnosable:
        more = (
            f"; {format_count(len(found.attention), 'remark')} below"
            if found.attention
            else ""
        )
        answer = f"{found.campaign} can be diagnosed: {format_count(found.testable, 'candidate effect')} can be tested{more}"
    details = [
        *(f"{name:<16}{words}" for name, words in found.rows),
        *(f"! {sentence}" for sentence in found.attention),
    ]
    following = (
        f"elastocal diagnose {folder}"
        if found.diagnosable
        else "mend the data, then check again"
    )
    print_answer(found.diagnosable, answer, details, following, console)
    raise typer.Exit(0 if found.diagnosable else 1)


def diagnose(
    folder: Annotated[Path, Argument(help="Folder of the campaign.")],
    cores: Annotated[
        int,
        Option("--cores", "-j", min=1, max=MOST_ROWS, help="Jobs that run at a time."),
    ] = 2,
) -> None:
    """Find which effects the robot's model lacks; write the report.

    The report compares the error before and after on held-out poses. It is the
    Snakemake target `diagnose` of this campaign.
    """
    from rich.console import Console

    campaign = str(folder.resolve())
    console = Console(stderr=True)
    # Braces are wildcards to Snakemake, the others mapping and comment of YAML.
    if mark := next(
        (mark for mark in ("{", "}", ": ", " #") if mark in campaign),
        find_control_character(campaign),
    ):
        raise InputError(
            folder,
            "",
            repr(mark),
            "a path without it, which Snakemake does not take for a path",
        )
    place = workplace()
    snakefile = pipeline() / "Snakefile"
    words = [
        "-m",
        "snakemake",
        f"-j{cores}",
        "diagnose",
        "--config",
        f"campaign={campaign}",
    ]
    # What is installed beside the package runs in the working directory.
    words += [] if snakefile.parent == place else ["--snakefile", str(snakefile)]
    current = False
    with subprocess.Popen(
        [sys.executable, *words],
        cwd=place,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as run:
        for line in map(str.rstrip, run.stdout or ()):
            current = current or line.startswith(_NOTHING)
            if not line.startswith(_NO_NEWS):
                print_lines([line], console)
    # Where there is nothing to do, Snakemake prints no outcome.
    if current and not run.returncode:
        from elastocal.campaigns.campaign_folder import read_campaign_folder
        from elastocal.report.outcome import outcome

        name = read_campaign_folder(folder, robots()).name
        print_lines(outcome([f"reports/loop/{name}/report.pdf"], place), console)
    raise typer.Exit(run.returncode)
