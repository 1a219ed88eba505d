"""A campaign's folder: `elastocal init` creates it, `check` says what its data can show,
`diagnose` runs its Snakemake target."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer
from typer import Argument, Option

from elastocal.command.diagnosis_runs import (
    PROFILE_NOTICE,
    build_run_command,
    diagnose_folders,
    format_runs,
)
from elastocal.command.terminal import (
    MOST_ROWS,
    ForceOption,
    LengthsOption,
    TargetsOption,
    find_robots_folder,
    find_workplace,
    format_command,
    print_answer,
    print_lines,
    refuse_taken_name,
)
from elastocal.counting import format_count
from elastocal.errors import InputError, escape_control_characters

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import Console

_ROBOT = "robot.yaml"
_NOTHING_TO_DO = "Nothing to be done"
# Characters of a line that a terminal repeats while the step is at work.
_LONGEST_STEP = 60
_CORES_OF_ONE_CAMPAIGN = 2


def init(
    folder: Annotated[
        Path,
        Argument(help="New folder, or a folder with measurements or a robot file."),
    ],
    *,
    robot: Annotated[
        Path | None, Option(help="Robot file to copy into a folder without one.")
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
    _check_new_campaign(folder / DOCUMENT, folder / _ROBOT, robot)
    refuse_taken_name(folder.resolve().name, folder)
    arm = read_robot(robot or folder / _ROBOT)
    targets, measured = read_measured_targets(folder)
    files = {}
    if robot is not None:
        files[_ROBOT] = read_text(robot, LARGEST_BYTES)
    if not (folder / CSV).exists() and not (folder / PARQUET).exists():
        files[CSV] = format_sheet_header(arm.commands)
    files[DOCUMENT] = format_campaign_template(
        folder.resolve().name, arm, targets, measured
    )
    with write_together(folder, files) as partial:
        for name, text in files.items():
            write_text(partial / name, text)
    task = "fill in measurements.csv"
    if targets:
        task = "check campaign.yaml for the frame and where targets sit"
    print_answer(
        f"{folder.as_posix()}: {', '.join(files)}",
        [],
        f"{task}, then elastocal check {folder.as_posix()}",
        Console(),
    )


def _check_new_campaign(document: Path, robot_file: Path, robot: Path | None) -> None:
    """Refuse a campaign that exists, and more or less than one robot file."""
    if document.exists():
        raise InputError(
            document,
            "",
            "a campaign that is there already",
            "a folder without campaign.yaml",
        )
    if robot_file.exists() == (robot is not None):
        fault = "a robot that is there already" if robot else "no robot file"
        allowed = "one robot file: there, or with --robot"
        raise InputError(robot_file, "", fault, allowed)


def check(folder: Annotated[Path, Argument(help="Folder of the campaign.")]) -> None:
    """Show what a campaign identifies and what looks suspicious.

    The exit code is 1 where the data are at fault and cannot be diagnosed.
    """
    from rich.console import Console

    from elastocal.campaigns.campaign_folder import (
        check_workflow_path,
        read_campaign_folder,
    )
    from elastocal.loop.overview import inspect_campaign

    # The next command is `diagnose`, which refuses such a path and such a name.
    check_workflow_path(str(folder.resolve()))
    on_disk = read_campaign_folder(folder, find_robots_folder())
    refuse_taken_name(on_disk.name, on_disk.source)
    report = inspect_campaign(folder, find_robots_folder())
    next_step = "mend the data, then check again"
    if report.diagnosable:
        next_step = format_command("diagnose", folder)
    details = [f"{name:<16}{sentence}" for name, sentence in report.rows]
    details += [f"! {sentence}" for sentence in report.attention]
    passed = report.diagnosable
    print_answer(report.answer, details, next_step, Console(), passed=passed)
    raise typer.Exit(0 if report.diagnosable else 1)


def diagnose(
    folders: Annotated[
        list[Path],
        Argument(metavar="FOLDER...", help="Folder of the campaign, or several."),
    ],
    *,
    cores: Annotated[
        int | None,
        Option(
            "--cores",
            "-j",
            min=1,
            max=MOST_ROWS,
            help="Jobs that run at a time: 2 for one campaign. Of several campaigns one"
            " runs on each core of this machine.",
        ),
    ] = None,
    measured: Annotated[
        Path | None,
        Option(
            "--with",
            help="Measurements at corrected targets, as for elastocal verify. They are added"
            " to a new campaign, NAME_round2, beside this one, which is diagnosed.",
        ),
    ] = None,
    targets: TargetsOption = None,
    lengths: LengthsOption = None,
    force: ForceOption = False,
) -> None:
    """Find which effects the robot's model lacks; write the report.

    The report compares the error before and after on held-out poses. It is the
    Snakemake target `diagnose` of this campaign. With --with it goes round the loop
    again: the measurements of the corrected robot are joined to the campaign as a
    further session, in a new folder. Several campaigns run side by side, a process
    each; one that fails stops no other, and a table of all stands at the end.
    """
    from rich.console import Console

    console = Console(stderr=True)
    folder = folders[0]
    if len(folders) > 1:
        _refuse_joining(folders, measured)
        _diagnose_several(folders, cores, console)
    if measured is not None:
        folder = _join_measurements(
            folder, measured, targets, lengths, console, force=force
        )
    workplace = find_workplace()
    with subprocess.Popen(
        build_run_command(folder, cores or _CORES_OF_ONE_CAMPAIGN, workplace),
        cwd=workplace,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        nothing_to_do = _follow_run(process.stdout or (), console)
    # If there is nothing to do, Snakemake prints no outcome.
    if nothing_to_do and not process.returncode:
        _print_outcome(folder, workplace, console)
    raise typer.Exit(process.returncode)


def _refuse_joining(folders: Sequence[Path], measured: Path | None) -> None:
    """Refuse measurements of a corrected robot for several campaigns."""
    if measured is not None:
        found = format_count(len(folders), "campaign")
        allowed = "one campaign, whose robot was measured"
        raise InputError("--with", str(measured), found, allowed)


def _diagnose_several(
    folders: Sequence[Path], cores: int | None, console: Console
) -> NoReturn:
    """Diagnose campaigns side by side and print a table; the exit code is 1 if one
    failed."""
    from rich.console import Console

    processes = min(len(folders), cores or os.cpu_count() or 1)
    runs = diagnose_folders(folders, processes, console)
    print_lines(format_runs(runs), Console())
    raise typer.Exit(int(any(run.fault for run in runs)))


def _follow_run(lines: Iterable[str], console: Console) -> bool:
    """Print the lines of a run as they come; return whether there was nothing to do.

    A terminal shows below them for how long the last step has been at work, so that a
    long fit does not look like a program that hangs.
    """
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    nothing_to_do = False
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        task = progress.add_task("", total=None)
        for line in map(str.rstrip, lines):
            nothing_to_do = nothing_to_do or line.startswith(_NOTHING_TO_DO)
            if line.startswith(PROFILE_NOTICE):
                continue
            print_lines([line], console)
            step = escape_control_characters(line)[:_LONGEST_STEP]
            progress.reset(task, total=None, description=step)
    return nothing_to_do


def _join_measurements(
    folder: Path,
    measured: Path,
    targets: Path | None,
    lengths: str | None,
    console: Console,
    *,
    force: bool,
) -> Path:
    """Write a campaign with the measurements of this one and those at its corrected
    targets; return its folder."""
    from elastocal.campaigns.campaign_folder import read_campaign_folder
    from elastocal.io.replacement import check_replaceable, note_written_files
    from elastocal.loop import verification
    from elastocal.loop.loading import read_described_campaign

    campaign_folder = read_campaign_folder(folder, find_robots_folder())
    _, campaign = read_described_campaign(campaign_folder)
    output, name = verification.name_next_round(campaign_folder)
    targets_path = targets or measured.with_name(verification.TARGETS)
    files = verification.list_round_files(campaign_folder, output)
    inputs: list[str | Path] = [*campaign_folder.files(), measured, targets_path]
    check_replaceable(files, inputs, find_workplace(), force=force)
    read = verification.read_verification(measured, targets_path, campaign, lengths)
    remarks = verification.join_measurements(campaign_folder, *read, output, name)
    note_written_files(files, find_workplace())
    count = format_count(len(read[1]), "measurement")
    lines = [f"{output}: {folder} with {count} of the corrected robot"]
    print_lines([*lines, *(f"! {remark}" for remark in remarks)], console)
    return output


def _print_outcome(folder: Path, workplace: Path, console: Console) -> None:
    """Print the outcome of a diagnosis that is up to date."""
    from elastocal.campaigns.campaign_folder import read_campaign_folder
    from elastocal.report.outcome import describe_outcome

    name = read_campaign_folder(folder, find_robots_folder()).name
    print_lines(
        describe_outcome([f"reports/loop/{name}/report.pdf"], workplace, folder),
        console,
    )
