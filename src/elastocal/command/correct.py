"""`elastocal correct`: joint targets that reach wanted poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Exit, Option

from elastocal.command.terminal import (
    AnglesOption,
    ColumnOption,
    DecimalOption,
    ForceOption,
    IgnoreOption,
    LengthsOption,
    RotationOption,
    UnitOption,
    find_workplace,
    format_command,
    load_correctable,
    parse_pairs,
    parse_units,
    print_answer,
)
from elastocal.errors import InputError

if TYPE_CHECKING:
    from elastocal.application.path_correction import CorrectedPath
    from elastocal.exchange.controllers import Controller
    from elastocal.mechanics.robot import Robot


def correct(
    folder: Annotated[
        Path, Argument(help="Folder of a diagnosed campaign, or a model file.")
    ],
    path: Annotated[
        Path,
        Argument(
            help="CSV of wanted poses: x, y, z in m, rx, ry, rz in rad; fx..fz or"
            " fx..mz, q1..qn. Options for other tables: units such as mm and degrees,"
            " Euler angles."
        ),
    ],
    *,
    output: Annotated[Path, Option(help="CSV of joint targets.")],
    language: Annotated[
        str,
        Option(
            "--format",
            help="Write a program beside the CSV too: krl (KUKA), rapid (ABB),"
            " tp (FANUC), urscript.",
        ),
    ] = "",
    axes: Annotated[
        str,
        Option(
            help="Controller names of q1..qn, such as A1,A2,E1,A3,A4,A5,A6;"
            " needed if they are ambiguous."
        ),
    ] = "",
    allow_large_steps: Annotated[
        bool,
        Option(
            "--allow-large-steps",
            help="Accept joint rotations of more than 5 times the rotation of the path"
            " and 10 degrees.",
        ),
    ] = False,
    partial: Annotated[
        bool,
        Option(
            "--partial",
            help="Leave out poses that cannot be corrected, and end with exit code 1.",
        ),
    ] = False,
    angles: AnglesOption = None,
    lengths: LengthsOption = None,
    rotation: RotationOption = None,
    column: ColumnOption = None,
    ignore: IgnoreOption = None,
    unit: UnitOption = None,
    decimal: DecimalOption = None,
    force: ForceOption = False,
) -> None:
    """Compute the joint targets that reach the wanted poses.

    Loads, weight and every effect found are compensated, and where joints and loads
    were fitted what a regression predicts of the rest, if the diagnosis chose one. Each
    target states by how much the robot will miss it. Posture and turns of the joints
    are those that move the robot least; where q1..qn state them they are kept. A joint
    that swings from target to target, or a stated posture that does not reach its
    target, is refused with its line. Predicted errors are stated as `elastocal
    certificate` states them: in the frame of the declared base, or, where the base is
    unknown, in the robot's own frame after its best placement over the campaign's
    poses.
    """
    from rich.console import Console

    from elastocal.application.path_correction import (
        correct_path,
        describe_path_accuracy,
        describe_path_warnings,
        describe_regression,
    )
    from elastocal.exchange.pose_table import TableOptions
    from elastocal.exchange.target_path import read_target_path_for
    from elastocal.io.replacement import check_replaceable, note_written_files

    console = Console(stderr=True)
    program = _plan_program(output, language, axes)
    files = [output, program.path] if program else [output]
    if not output.parent.is_dir():
        allowed = "a file in a folder that is there"
        raise InputError(output, "", "no such folder", allowed)
    campaign = load_correctable(folder)
    inputs: list[str | Path] = [*campaign.files, path]
    check_replaceable(files, inputs, find_workplace(), force=force)
    robot = campaign.calibrated.robot
    axis_names = program.name_axes(robot) if program else ()
    options = TableOptions(
        decimal=decimal,
        columns=parse_pairs("--column", column),
        units=parse_units(unit, angles, lengths),
        rotation=rotation,
        ignore=ignore or [],
    )
    wanted = read_target_path_for(path, robot, options)
    with console.status("correcting"):
        corrected = correct_path(
            campaign.calibrated,
            wanted,
            path,
            allow_large_steps=allow_large_steps,
            partial=partial,
        )
    _write_targets(output, corrected, campaign.name, program, axis_names)
    note_written_files(files, find_workplace())
    details = describe_path_accuracy(corrected)
    if details and not campaign.measures_poses:
        details.append(
            "orientations were not measured: their error does not include rotations of"
            " the tool that positions do not show"
        )
    remainder = campaign.verdict.remainder
    if remainder and campaign.calibrated.residual_model:
        details.append(describe_regression(corrected, remainder.words))
    if program:
        details.append(program.describe(axis_names))
    warnings = [frame.sentence for frame in campaign.verdict.misplaced]
    warnings += describe_path_warnings(corrected)
    details += [f"! {warning}" for warning in warnings]
    details.append(str(output))
    if program:
        details.append(str(program.path))
    is_complete = bool(corrected.outcome.is_corrected.all())
    print_answer(
        f"{corrected.share} corrected",
        details,
        _format_next_step(folder),
        console,
        passed=is_complete,
    )
    if not is_complete:
        raise Exit(1)


def _format_next_step(folder: Path) -> str:
    """Format the next command; a model file has none."""
    if folder.is_file():
        return ""
    return format_command("certificate", folder, "--tolerance", "0.2mm")


@dataclass(frozen=True)
class _Program:
    """A robot program to be written.

    Attributes
    ----------
    controller : its language.
    path : its file, beside the CSV of joint targets.
    name : name of the program, which the controller allows.
    stated_axes : names of the axes as the user has typed them; empty if not.
    """

    controller: Controller
    path: Path
    name: str
    stated_axes: str

    def name_axes(self, robot: Robot) -> tuple[str, ...]:
        """Return the controller's names of q1, q2, ..."""
        from elastocal.exchange.controllers import find_axes

        return find_axes(self.controller, robot.prismatic_commands, self.stated_axes)

    def describe(self, axis_names: tuple[str, ...]) -> str:
        """Say which controller reads the program, and what it calls the joints."""
        joints = ", ".join(
            f"q{number} as {axis}" for number, axis in enumerate(axis_names, 1)
        )
        language = self.controller.words
        return f"{self.path.name} goes to all of them: {language}, {joints}"


def _plan_program(output: Path, language: str, axes: str) -> _Program | None:
    """Refuse options that do not go together; None if no program is wanted."""
    from elastocal.exchange.controllers import check_name, find_controller

    controller = find_controller(language) if language else None
    if output.suffix != ".csv":
        raise InputError(
            "--output",
            "",
            repr(output.name),
            "a name that ends in .csv; --format writes a program beside it",
        )
    if controller is None:
        if axes:
            raise InputError("--axes", "", repr(axes), "with --format")
        return None
    path = output.with_suffix(controller.suffix)
    return _Program(controller, path, check_name(controller, path), axes)


def _write_targets(
    output: Path,
    corrected: CorrectedPath,
    campaign: str,
    program: _Program | None,
    axis_names: tuple[str, ...],
) -> None:
    """Write the CSV of joint targets and the program, both or none."""
    from elastocal.application.path_correction import describe_program, tabulate_targets
    from elastocal.exchange.controllers import build_targets
    from elastocal.io.atomic_writes import write_text, write_together
    from elastocal.io.data_frames import write_csv

    names = [output.name]
    if program:
        names.append(program.path.name)
    with write_together(output.parent, names) as partial:
        write_csv(partial / output.name, tabulate_targets(corrected))
        if program:
            targets = build_targets(
                corrected.correction.joint_angles,
                corrected.calibrated.robot.prismatic_commands,
                axis_names,
            )
            text = program.controller.program(
                program.name, targets, describe_program(corrected, campaign)
            )
            write_text(partial / program.path.name, text)
