"""`elastocal correct`: wanted poses to the joint targets that bring the robot there."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from elastocal.command.campaign import AcceptEnvironment, diagnosed_campaign
from elastocal.command.printed import print_answer, print_lines
from elastocal.counting import counted, first_names, grouped
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from elastocal.application.accuracy import Prediction
    from elastocal.application.compensation import Correction
    from elastocal.exchange.controllers.protocol import Controller
    from elastocal.exchange.target_path import TargetPath

# Lines that a message names.
_NAMED = 5


def correct(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    path: Annotated[Path, Argument(help="CSV of wanted poses: x, y, z in m, rx, ry, rz in rad; fx..mz, q1..qn.")],
    output: Annotated[
        Path,
        Option(
            help="CSV of joint targets; or a program for a controller by its suffix, .src, .mod, .ls, .script, beside a CSV."
        ),
    ],
    language: Annotated[
        str, Option("--format", help="Write a program beside the CSV too: krl (KUKA), rapid (ABB), tp (FANUC), urscript.")
    ] = "",
    axes: Annotated[
        str, Option(help="What the controller calls q1..qn, such as A1,A2,E1,A3,A4,A5,A6; needed where it is ambiguous.")
    ] = "",
    partial: Annotated[bool, Option("--partial", help="Write the file even if some targets cannot be reached.")] = False,
    accept_environment: AcceptEnvironment = False,
) -> None:
    """Compute the joint targets that reach the wanted poses.

    Loads, weight and every effect found are compensated, and each target states by how much the robot will miss it.
    Predicted errors are stated as `elastocal certificate` states them: in the frame of the declared base, or, where the base is
    unknown, in the robot's own frame after its best placement over the campaign's poses.
    """
    import numpy as np
    from rich.console import Console
    from rich.progress import Progress

    from elastocal.application.accuracy import accuracy_sentence, before_m, millimetres, predict_errors
    from elastocal.application.calibrated import OperatingConditions, assumptions
    from elastocal.application.compensation import find_joint_targets
    from elastocal.application.scope import campaign_accuracy
    from elastocal.exchange.controllers.protocol import axes_of, check_name, targets_of
    from elastocal.exchange.target_path import OK, read_target_path
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.data_frames import write_csv
    from elastocal.validation.fitted_range import beyond_campaign

    console = Console(stderr=True)
    controller, table, program = _places_of(output, language)
    if axes and controller is None:
        raise InputError("--axes", "", repr(axes), "with --format, or an --output that is a program")
    name = check_name(controller, program) if controller else ""
    check_places(table, program)
    if not output.parent.is_dir():
        raise InputError(output, "", "no such folder", "a file in a folder that is there")
    campaign = diagnosed_campaign(folder, accept_environment)
    calibrated = campaign.calibrated
    prismatic = calibrated.robot.chain.prismatic
    named = axes_of(controller, prismatic, axes) if controller else ()
    wanted = read_target_path(path, calibrated.robot.joints)
    operating = OperatingConditions(wanted.wrench, wanted.approach, wanted.time_s, wanted.temperature_c)
    print_lines((f"assumed: {line}" for line in assumptions(calibrated, operating)), console)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        bar = progress.add_task("correcting", total=len(wanted))
        found = find_joint_targets(
            calibrated,
            wanted.position,
            wanted.rotation,
            operating,
            wanted.start,
            lambda done: progress.update(bar, completed=done),
        )
    bad = (found.status != OK).nonzero()[0]
    if len(bad) and not partial:
        rows = first_names([f"line {wanted.lines[row]} is {found.status[row]}" for row in bad], _NAMED)
        raise InputError(path, "", rows, "poses that the robot reaches within its limits, or --partial")
    good = found.status == OK
    if controller and not good.any():
        raise InputError(path, "", "no pose that the robot reaches", "one at least, for a program")
    beyond = beyond_campaign(
        campaign.case.observations.states, calibrated.robot.model_angles(found.joint_angles), wanted.wrench
    )
    errors = predict_errors(calibrated, found.joint_angles, operating)
    before = before_m(calibrated, wanted.position, wanted.rotation, found.error_before)
    files = [table, program] if controller else [table]
    with write_together(output.parent, [file.name for file in files]) as folder_of_all:
        write_csv(folder_of_all / table.name, _joint_targets(wanted, found, before, errors, beyond))
        if controller:
            targets = targets_of(found.joint_angles[good], prismatic, named)
            write_text(folder_of_all / program.name, controller.program(name, targets))
    lines, answer = [], f"{grouped(good.sum())} of {counted(len(good), 'target')} corrected"
    if good.any():
        rms = np.sqrt((before[good] ** 2).mean())
        reachable = predict_errors(calibrated, found.joint_angles[good], operating.part(good)) if len(bad) else errors
        lines.append(f"Predicted position error without correction, in the same frame: {millimetres(rms)} RMS.")
        lines.append(accuracy_sentence(reachable.accuracy("the targets")))
        lines.append(accuracy_sentence(campaign_accuracy(calibrated, campaign.case.observations.states)))
    if controller:
        called = ", ".join(f"q{number} as {axis}" for number, axis in enumerate(named, 1))
        lines.append(
            f"{program.name} goes to {grouped(good.sum())} of {counted(len(good), 'target')}: {controller.WORDS}, {called}"
        )
    if beyond.any():
        share = f"{grouped(beyond.sum())} of {counted(len(beyond), 'target')}"
        lines.append(f"! {share} lie beyond the poses or loads of the campaign: their predicted errors are extrapolated")
    certify = f"elastocal certificate {folder} --tolerance 0.2mm"
    following = f"{certify}; or command 12 targets or more, measure them, and add --measured AFTER"
    print_answer(not len(bad), answer, [*lines, *map(str, files)], following, console)


def _places_of(output: Path, language: str) -> tuple[Controller | None, Path, Path]:
    """The language of a program, if there shall be one, and where the CSV and the program go."""
    from elastocal.exchange.controllers.catalogue import controller_of

    by_suffix = controller_of("", output.suffix)
    controller = controller_of(language, "") if language else by_suffix
    if controller is None:
        return None, output, output
    if by_suffix not in (None, controller):
        allowed = f"{controller.SUFFIX} | .csv"
        raise InputError(output, "--output", f"a program in another language than {controller.WORDS}", allowed)
    return controller, output.with_suffix(".csv") if by_suffix else output, output.with_suffix(controller.SUFFIX)


def _joint_targets(
    wanted: TargetPath, found: Correction, before: np.ndarray, errors: Prediction, beyond: np.ndarray
) -> pd.DataFrame:
    """The file of joint targets: wanted poses, commands q1..qn (rad, as the controller reports them), predicted errors, status.

    `before` (N,) is what uncorrected targets would be missed by, m; `beyond` whether each lies beyond what was measured.
    """
    import numpy as np
    import pandas as pd
    from scipy.spatial.transform import Rotation

    pose = np.column_stack([wanted.position, Rotation.from_matrix(wanted.rotation).as_rotvec()])
    columns = dict(zip(("x", "y", "z", "rx", "ry", "rz"), pose.T, strict=True))
    angles = {f"q{joint}": column for joint, column in enumerate(found.joint_angles.T, 1)}
    nominal = {f"q{joint}_uncorrected": column for joint, column in enumerate(found.uncorrected.T, 1)}
    stated = {
        "predicted_error_before_m": before,
        "predicted_error_after_m": errors.error_m,
        "predicted_bound_m": errors.bound_m,
        "predicted_std_m": np.hypot(errors.parameters_m, errors.repeated_m),
        "predicted_rotation_before_rad": np.linalg.norm(found.error_before[:, 3:], axis=1),
        "predicted_rotation_std_rad": errors.std_rad,
        "repeatability_m": errors.repeated_m,
        "outside_range": beyond,
    }
    return pd.DataFrame(angles | stated | {"status": found.status} | columns | nominal)
