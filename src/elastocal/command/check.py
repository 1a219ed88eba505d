"""`elastocal check`: what a campaign can show, before it is diagnosed."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from elastocal.command.pipeline import pipeline
from elastocal.errors import escaped

if TYPE_CHECKING:
    from collections.abc import Mapping

# Held parameters that are named; of more there are too many to read.
_NAMED = 8


def check(
    folder: Annotated[Path, typer.Argument(help="Folder of the campaign.")],
    as_json: Annotated[bool, typer.Option("--json", help="All that was found, as JSON on standard output.")] = False,
) -> None:
    """Say what was read, what these measurements identify and test, and what is suspicious; exit code 1 if not diagnosable."""
    from elastocal.loop.overview import overview

    facts = overview(folder, pipeline() / "config" / "robots")
    if as_json:
        json.dump(facts, sys.stdout, indent=1)
        print()
    else:
        show(facts, Console())
    raise typer.Exit(0 if facts["diagnosable"] else 1)


def show(facts: Mapping[str, Any], console: Console) -> None:
    """Print what `overview` found."""
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for name, words in lines(facts):
        table.add_row(name, escaped(words))
    console.print(table)


def lines(facts: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What is shown, as pairs of a heading and words."""
    from elastocal.application.accuracy import accuracy_from, accuracy_sentence

    noise = facts["noise"]
    left = f"; not identifiable: {_listed(facts['held'])}" if facts["held"] else ""
    sessions = f", {facts['sessions']} sessions" if facts["sessions"] > 1 else ""
    robot = f"{facts['campaign']}: {facts['robot']}, {facts['joints']} joints"
    poses = f"{facts['training']['poses']} poses to fit and {facts['held_out']['poses']} validation poses"
    # Numbers of loads are labels; 0 is none.
    loaded = len(facts["loads"]) - (0 in facts["loads"])
    parts = [*(["unloaded"] if 0 in facts["loads"] else []), *([f"{loaded} load{'s' * (loaded > 1)}"] if loaded else [])]
    loads = " and ".join(parts) + (f" of up to {facts['largest_force_N']:.0f} N" if loaded else "")
    repeats = "each state measured once" if facts["repeats"] == 1 else f"a state measured up to {facts['repeats']} times"
    found = [
        ("read", f"{robot}, {facts['measured']} in the {facts['frame']} frame"),
        ("", f"{poses}; {facts['measurements']} measurements of {', '.join(facts['targets'])}{sessions}"),
        ("", f"{loads}; {repeats}"),
        ("noise", f"{1e6 * noise['position_m']:.0f} µm a coordinate, by {_SOURCES[noise['source']]}"),
        ("declared model", f"leaves {1e3 * facts['residual_rms_m']:.3f} mm RMS on the poses that it was fitted to"),
        ("identified", f"{facts['parameters']} parameters, effectively {facts['effective_parameters']:.0f}{left}"),
    ]
    for joint, spring in enumerate(facts.get("compliance", []), 1):
        error = spring["relative_std_error"]
        words = "not identifiable" if error is None else f"± {100 * error:.1f} %"
        found.append(
            ("compliance" if joint == 1 else "", f"joint {joint}: {spring['value_urad_per_Nm']:.3g} µrad/(N m) {words}")
        )
    if facts["accuracy"]:
        sentence = accuracy_sentence(accuracy_from(facts["accuracy"]))
        found.append(("accuracy", f"if nothing is missing in the declared model: {sentence}"))
    found.append(("testable", f"{facts['testable']} candidate effects"))
    found += [("", f"{count} not: {reason}") for reason, count in facts["untestable"].items()]
    found += [("data fault", fault["sentence"]) for fault in facts["faults"]]
    found += [("suspicious", sentence) for sentence in facts["suspicious"]]
    found.append(("diagnosable", "yes" if facts["diagnosable"] else "no: the data are at fault"))
    return found


_SOURCES = {"repeats": "repeats", "declared": "the campaign's declaration", "residual": "what the declared model leaves"}


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
