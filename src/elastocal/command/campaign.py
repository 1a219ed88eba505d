"""A campaign's folder: `elastocal init` begins it, `check` says what it can show, `diagnose` runs its Snakemake target."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from elastocal.command.pipeline import pipeline, robots, workplace
from elastocal.command.terminal import MOST_ROWS, print_answer, print_lines
from elastocal.counting import counted, first_names
from elastocal.errors import InputError, escaped, steering

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

# Parameters that are not identifiable and are named; more would be too many to read.
_NAMED = 8
_SOURCES = {"repeats": "repeats", "declared": "the campaign's declaration", "residual": "the residual of the declared model"}
# Snakemake prints the second before its logger begins.
_NOTHING, _NO_NEWS = "Nothing to be done", "Using workflow specific profile"


def init(
    folder: Annotated[Path, Argument(help="New folder, or one that has measurements or a robot file already.")],
    robot: Annotated[Path | None, Option(help="Robot file to copy there; a template where there is none.")] = None,
) -> None:
    """Begin a campaign: a folder with files to fill in.

    campaign.yaml explains every key, and has the targets of measurements that lie there. No file that exists is replaced.
    """
    from rich.console import Console

    from elastocal.campaigns.campaign import DOCUMENT
    from elastocal.campaigns.measurements import CSV, PARQUET, described_by
    from elastocal.campaigns.reading import read_robot
    from elastocal.campaigns.writing import campaign_template, robot_template, sheet_template
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.documents import LARGEST_BYTES
    from elastocal.io.texts import read_text

    place = folder / "robot.yaml"
    check_places(place, *(folder / name for name in (DOCUMENT, CSV, PARQUET)))
    if (folder / DOCUMENT).exists():
        raise InputError(folder / DOCUMENT, "", "a campaign that is there already", "a folder without campaign.yaml")
    if robot is not None and place.exists():
        raise InputError(place, "", "a robot that is there already", "a folder without robot.yaml, or no --robot")
    text = robot_template() if robot is None else read_text(robot, LARGEST_BYTES)
    source = place if place.exists() else robot
    arm = None if source is None else read_robot(source)
    there = [name for name in (place.name, CSV, PARQUET) if (folder / name).exists()]
    targets, measured = described_by(folder)
    written = [name for name in (place.name, CSV, DOCUMENT) if name not in there and (name != CSV or PARQUET not in there)]
    with write_together(folder, written) as partial:
        if place.name in written:
            write_text(partial / place.name, text)
        arm = arm or read_robot(partial / place.name)
        if CSV in written:
            write_text(partial / CSV, sheet_template(arm.joints))
        write_text(partial / DOCUMENT, campaign_template(folder.resolve().name, arm, targets, measured))
    template = ["! robot.yaml is a template: enter your robot's chain and lengths, or use `elastocal import urdf` or `dh`"]
    answer = f"{folder.as_posix()}: {', '.join(written)}"
    first = "check campaign.yaml for the frame and where targets sit" if targets else "fill in measurements.csv"
    following = f"{first}, then elastocal check {folder.as_posix()}"
    print_answer(True, answer, template if source is None else [], following, Console())


def check(folder: Annotated[Path, Argument(help="Folder of the campaign.")]) -> None:
    """Show what a campaign identifies and what looks suspicious.

    The exit code is 1 where the data are at fault and cannot be diagnosed.
    """
    from rich.console import Console
    from rich.table import Table

    from elastocal.loop.overview import overview

    facts, console = overview(folder, robots()), Console()
    attention = [*(fault["sentence"] for fault in facts["faults"]), *facts["suspicious"]]
    answer = f"{facts['campaign']} cannot be diagnosed: the data are at fault"
    if facts["diagnosable"]:
        more = f"; {counted(len(attention), 'remark')} below" if attention else ""
        answer = f"{facts['campaign']} can be diagnosed: {counted(facts['testable'], 'candidate effect')} can be tested{more}"
    print_answer(facts["diagnosable"], answer, [], "", console)
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, words in _lines(facts):
        table.add_row(f"  {name}", escaped(words))
    console.print(table)
    following = f"elastocal diagnose {folder}" if facts["diagnosable"] else "mend the data, then check again"
    print_lines([*(f"! {sentence}" for sentence in attention), f"next: {following}"], console)
    raise typer.Exit(0 if facts["diagnosable"] else 1)


def _lines(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The table, as pairs of a heading and words."""
    from elastocal.application.accuracy import accuracy_from, accuracy_sentence

    noise = facts["noise"]
    left = f"; not identifiable: {first_names(facts['held'], _NAMED)}" if facts["held"] else ""
    sessions = f", {facts['sessions']} sessions" if facts["sessions"] > 1 else ""
    robot = f"{facts['campaign']}: {facts['robot']}, {counted(facts['joints'], 'joint')}"
    poses = f"{counted(facts['training']['poses'], 'pose')} to fit and {counted(facts['held_out']['poses'], 'validation pose')}"
    # Numbers of loads are labels; 0 is none.
    loaded = len(facts["loads"]) - (0 in facts["loads"])
    parts = [*(["unloaded"] if 0 in facts["loads"] else []), *([counted(loaded, "load")] if loaded else [])]
    loads = " and ".join(parts) + (f" of up to {facts['largest_force_N']:,.0f} N" if loaded else "")
    repeats = "each state measured once" if facts["repeats"] == 1 else f"a state measured up to {facts['repeats']} times"
    found = [
        ("read", f"{robot}, {facts['measured']} in the {facts['frame']} frame"),
        ("", f"{poses}; {counted(facts['measurements'], 'measurement')} of {', '.join(facts['targets'])}{sessions}"),
        ("", f"{loads}; {repeats}"),
        ("noise", f"{1e6 * noise['position_m']:.0f} µm a coordinate, from {_SOURCES[noise['source']]}"),
        ("declared model", f"residual of {1e3 * facts['residual_rms_m']:.3f} mm RMS on the fitted poses"),
        ("identified", f"{counted(facts['parameters'], 'parameter')}, effectively {facts['effective_parameters']:.0f}{left}"),
    ]
    for mount in facts["mounts"]:
        rotation = ", ".join(f"{value:.4f}" for value in mount["rotation_rad"])
        found.append(("mount", f"{mount['target']}: rotation [{rotation}] rad in the frame of its point, fitted"))
    springs = {f"joint {joint}": spring for joint, spring in enumerate(facts["compliance"], 1)}
    known = [
        f"{joint} {spring['value_urad_per_Nm']:.3g} ± {100 * spring['relative_std_error']:.1f} %"
        for joint, spring in springs.items()
        if spring["value_urad_per_Nm"] is not None
    ]
    if known:
        found.append(("compliance", f"if the declared model is complete, in µrad/(N m): {', '.join(known)}"))
    if unknown := [joint for joint, spring in springs.items() if spring["value_urad_per_Nm"] is None]:
        found.append(("" if known else "compliance", f"not determined by these poses: {', '.join(unknown)}"))
    if facts["accuracy"]:
        sentence = accuracy_sentence(accuracy_from(facts["accuracy"]))
        found.append(("accuracy", f"if the declared model is complete: {sentence}"))
    found.append(("testable", counted(facts["testable"], "candidate effect")))
    found += [("", f"{count} not testable: {reason}") for reason, count in facts["untestable"].items()]
    return found


def diagnose(
    folder: Annotated[Path, Argument(help="Folder of the campaign.")],
    cores: Annotated[int, Option("--cores", "-j", min=1, max=MOST_ROWS, help="Jobs that run at a time.")] = 2,
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
        current = _follow(run.stdout or (), Console(stderr=True))
    if current and not run.returncode:
        print_lines(_outcome(folder, place), Console(stderr=True))
    raise typer.Exit(run.returncode)


def _follow(lines: Iterable[str], console: Console) -> bool:
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

    return outcome([f"reports/loop/{read_descriptions(folder, robots())[0]['campaign']}/report.pdf"], place)
