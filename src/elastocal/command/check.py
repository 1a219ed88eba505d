"""`elastocal check`: what a campaign can show, before it is diagnosed."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from elastocal.command.pipeline import pipeline
from elastocal.command.printed import print_answer, print_lines
from elastocal.counting import counted, first_names
from elastocal.errors import escaped

if TYPE_CHECKING:
    from rich.console import Console

# Parameters that are not identifiable and are named; more would be too many to read.
_NAMED = 8


def check(
    folder: Annotated[Path, Argument(help="Folder of the campaign.")],
    as_json: Annotated[bool, Option("--json", help="Print everything that was found as JSON.")] = False,
) -> None:
    """Show what a campaign identifies and what looks suspicious.

    The exit code is 1 where the data are at fault and cannot be diagnosed.
    """
    from rich.console import Console

    from elastocal.loop.overview import overview

    facts = overview(folder, pipeline() / "config" / "robots")
    if as_json:
        json.dump(facts, sys.stdout, indent=1)
        print()
    else:
        show(facts, folder, Console())
    raise typer.Exit(0 if facts["diagnosable"] else 1)


def show(facts: Mapping[str, Any], folder: Path, console: Console) -> None:
    """Print what `overview` found: the answer, its table, what asks for attention and what comes next."""
    from rich.table import Table

    print_answer(facts["diagnosable"], answer(facts), [], "", console)
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, words in lines(facts):
        table.add_row(f"  {name}", escaped(words))
    console.print(table)
    print_lines((f"! {sentence}" for sentence in attention(facts)), console)
    print_lines(
        [f"next: elastocal diagnose {folder}" if facts["diagnosable"] else "next: mend the data, then check again"], console
    )


def answer(facts: Mapping[str, Any]) -> str:
    """Whether the campaign can be diagnosed, in one sentence."""
    name, count = facts["campaign"], len(attention(facts))
    if not facts["diagnosable"]:
        return f"{name} cannot be diagnosed: the data are at fault"
    more = f"; {counted(count, 'remark')} below" if count else ""
    return f"{name} can be diagnosed: {counted(facts['testable'], 'candidate effect')} can be tested{more}"


def attention(facts: Mapping[str, Any]) -> list[str]:
    """Faults of the data, then what is suspicious."""
    return [*(fault["sentence"] for fault in facts["faults"]), *facts["suspicious"]]


def lines(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
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


_SOURCES = {"repeats": "repeats", "declared": "the campaign's declaration", "residual": "the residual of the declared model"}
