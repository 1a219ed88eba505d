"""`elastocal demo`: the whole way, from a plan to a certificate, on a simulated
robot."""

import shlex
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from elastocal.command.terminal import (
    LARGEST_SEED,
    print_answer,
    print_lines,
    robots,
    workplace,
)
from elastocal.counting import format_count

# Fewer candidates than a real plan takes, for a demonstration of a minute.
_PLAN = (
    "--poses 25 --candidates 2000 --force 1000 --pull --base-known --measured pose --noise 60um --orientation-noise 60urad "
    "--target 6DoF=0,0,0 --target 3DoF=0,0,0"
)
# Of every real robot it is true, and so no secret.
_WEIGHTS = "gravity sag in the verdict is right too: the robot bends under its own weight, and its file declares none"


def demo(
    context: typer.Context,
    folder: Annotated[Path, Argument(help="New folder for the campaign.")] = Path(
        "elastocal-demo"
    ),
    effect: Annotated[
        list[str] | None,
        Option(help="Hidden effect, such as joint_tilt; may be repeated."),
    ] = None,
    seed: Annotated[
        int,
        Option(
            min=0, max=LARGEST_SEED, help="Seed of the robot's errors and of the noise."
        ),
    ] = 1,
) -> None:
    """Go the whole way on a simulated KUKA, in about a minute.

    A physical simulation with hidden defects stands in for the robot: it is planned
    for, measured, checked, diagnosed, corrected and certified by the commands that a
    real robot needs, which are printed. Nothing but this package is needed.
    """
    from rich.console import Console

    from elastocal.application.frames import root_mean_square
    from elastocal.campaigns.campaign_folder import read_campaign_folder
    from elastocal.campaigns.measurements import CSV
    from elastocal.campaigns.reading import read_robot
    from elastocal_proof.blind.rehearsal import (
        fill_sheet,
        hidden_robot,
        hidden_words,
        measured_errors,
        write_milling_path,
    )

    console = Console(stderr=True)
    file = robots() / "kuka.yaml"
    path = folder / "path.csv"
    targets = folder / "targets.csv"
    robot, defects = hidden_robot(file, seed, effect or ["transmission_harmonic"])
    command = context.find_root().command

    def run(*words: str | Path, may_fail: bool = False) -> None:
        print_lines(["", f"$ {shlex.join(['elastocal', *map(str, words)])}"], console)
        # Without the standalone mode click returns the exit code.
        code = command.main(
            [*map(str, words)], prog_name="elastocal", standalone_mode=False
        )
        if code and not may_fail:
            raise typer.Exit(code)

    run("plan", file, "--folder", folder, *_PLAN.split())
    count = fill_sheet(
        folder / CSV, read_campaign_folder(folder, robots()).document, robot, seed
    )
    print_lines(
        [
            "",
            f"# The simulated robot is measured: {format_count(count, 'measurement')} in {folder / CSV}",
        ],
        console,
    )
    run("check", folder)
    run("diagnose", folder)
    write_milling_path(path, read_robot(file), robot, seed)
    run("correct", folder, path, "--output", targets)
    run("certificate", folder, "--tolerance", "0.2mm", may_fail=True)
    missed = {
        name: 1e3 * root_mean_square(off)
        for name, off in measured_errors(path, targets, robot, seed).items()
    }
    answer = (
        f"The simulated robot follows a milling path under load: position error {missed['uncorrected']:.2f} mm RMS before, "
        f"{missed['corrected']:.3f} mm after (noise and repeatability alone: {missed['noise alone']:.3f} mm)"
    )
    details = [
        f"hidden in it: {hidden_words(defects, effect or ())}, beside errors of every link, joint zero, gear and weight",
        _WEIGHTS,
        f"report: {workplace() / 'reports' / 'loop' / folder.resolve().name / 'report.html'}",
    ]
    print_lines([""], console)
    better = missed["corrected"] < missed["uncorrected"]
    print_answer(
        better, answer, details, "the same with your robot: elastocal --help", console
    )
