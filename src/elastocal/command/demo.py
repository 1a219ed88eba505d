"""`elastocal demo`: the whole workflow, from a plan to a verification, on a simulated
robot."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from elastocal.command.terminal import (
    LARGEST_SEED,
    find_robots_folder,
    find_workplace,
    print_answer,
    print_lines,
)
from elastocal.counting import format_count

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Console

# Fewer candidates than a real plan takes, for a demonstration of a minute.
_PLAN = (
    "--poses 25 --candidates 2000 --force 1000 --pull --base-known --measured pose"
    " --noise 60um --orientation-noise 60urad --target 6DoF=0,0,0 --target 3DoF=0,0,0"
)
# This is true of every real robot, so it gives no secret away.
_WEIGHTS = (
    "gravity sag in the verdict is right too: the robot bends under its own weight,"
    " and its file declares none"
)


def demo(
    context: typer.Context,
    folder: Annotated[Path, Argument(help="New folder for the campaign.")] = Path(
        "elastocal-demo"
    ),
    *,
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
    """Run the whole workflow on a simulated KUKA, in about a minute.

    A physical simulation with hidden defects stands in for the robot: it is planned
    for, measured, checked, diagnosed, corrected, certified and verified by the commands
    that a real robot needs, which are printed. Nothing but this package is needed.
    """
    from rich.console import Console

    from elastocal.application.frames import root_mean_square
    from elastocal.campaigns.campaign_folder import read_campaign_folder
    from elastocal.campaigns.measurements import CSV
    from elastocal.campaigns.reading import read_robot
    from elastocal_proof.blind.rehearsal import (
        build_hidden_robot,
        describe_hidden_effects,
        fill_sheet,
        measure_errors,
        measure_targets,
        write_milling_path,
    )

    console = Console(stderr=True)
    robot_file = find_robots_folder() / "kuka.yaml"
    path = folder / "path.csv"
    targets = folder / "targets.csv"
    measured = folder / "measured.csv"
    robot, defects = build_hidden_robot(
        robot_file, seed, effect or ["transmission_harmonic"]
    )
    command = context.find_root().command

    def run(*arguments: str | Path, may_fail: bool = False) -> None:
        """Print a command and run it; end the demonstration if it fails."""
        texts = [*map(str, arguments)]
        print_lines(["", f"$ {shlex.join(['elastocal', *texts])}"], console)
        # Outside of its standalone mode click returns the exit code.
        code = command.main(texts, prog_name="elastocal", standalone_mode=False)
        if code and not may_fail:
            raise typer.Exit(code)

    run("plan", robot_file, "--folder", folder, *_PLAN.split())
    document = read_campaign_folder(folder, find_robots_folder()).document
    count = format_count(fill_sheet(folder / CSV, document, robot, seed), "measurement")
    note = f"# The simulated robot is measured: {count} in {folder / CSV}"
    print_lines(["", note], console)
    run("check", folder)
    run("diagnose", folder)
    write_milling_path(path, read_robot(robot_file), robot, seed)
    run("correct", folder, path, "--output", targets)
    run("certificate", folder, "--tolerance", "0.2mm", may_fail=True)
    count = format_count(
        measure_targets(targets, measured, document, robot, seed), "target"
    )
    note = f"# The corrected robot is measured: {count} in {measured}"
    print_lines(["", note], console)
    run("verify", folder, measured, may_fail=True)
    errors_mm = {
        name: 1e3 * root_mean_square(errors)
        for name, errors in measure_errors(path, targets, robot, seed).items()
    }
    defects_in_words = describe_hidden_effects(defects, effect or ())
    report = find_workplace() / "reports" / "loop" / folder.resolve().name
    print_lines([""], console)
    _print_result(errors_mm, defects_in_words, report / "report.html", console)


def _print_result(
    errors_mm: Mapping[str, float], defects: str, report: Path, console: Console
) -> None:
    """Print the errors of the simulated robot, and what was hidden in it."""
    print_answer(
        "The simulated robot follows a milling path under load:"
        f" position error {errors_mm['uncorrected']:.2f} mm RMS before,"
        f" {errors_mm['corrected']:.3f} mm after"
        f" (noise and repeatability alone: {errors_mm['noise alone']:.3f} mm)",
        [
            f"hidden in it: {defects},"
            " beside errors of every link, joint zero, gear and weight",
            _WEIGHTS,
            f"report: {report}",
        ],
        "the same with your robot: elastocal --help",
        console,
        passed=errors_mm["corrected"] < errors_mm["uncorrected"],
    )
