"""`elastocal correct`: wanted poses to the joint targets that bring the robot there."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from elastocal.command.terminal import PhysicsOnly, diagnosed_campaign, print_answer, print_lines
from elastocal.counting import counted, first_names, grouped
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from elastocal.application.accuracy import Prediction
    from elastocal.application.compensation import Correction
    from elastocal.exchange.target_path import TargetPath
    from elastocal.loop.calibrated_files import Diagnosed
    from elastocal.mechanics.robot import Robot

# Lines that a message names.
_NAMED = 5
# Loads beyond so many times the measured ones have no bound: stiffness that is fitted as a constant need not be one there.
_LOADS_BOUNDED = 2.0


def correct(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    path: Annotated[Path, Argument(help="CSV of wanted poses: x, y, z in m, rx, ry, rz in rad; fx..fz or fx..mz, q1..qn.")],
    output: Annotated[Path, Option(help="CSV of joint targets.")],
    language: Annotated[
        str, Option("--format", help="Write a program beside the CSV too: krl (KUKA), rapid (ABB), tp (FANUC), urscript.")
    ] = "",
    axes: Annotated[
        str, Option(help="What the controller calls q1..qn, such as A1,A2,E1,A3,A4,A5,A6; needed where it is ambiguous.")
    ] = "",
    allow_large_steps: Annotated[
        bool,
        Option("--allow-large-steps", help="Accept joints that turn by more than 5 times what the path turns, and 10 degrees."),
    ] = False,
    physics_only: PhysicsOnly = False,
    partial: Annotated[bool, Option("--partial", help="Write the file even if some targets cannot be reached.")] = False,
) -> None:
    """Compute the joint targets that reach the wanted poses.

    Loads, weight and every effect found are compensated, and where joints and loads were fitted what a regression predicts of
    the rest, if the diagnosis chose one. Each target states by how much the robot will miss it. Posture and
    turns of the joints are those that move the robot least; where q1..qn state them they are kept. A joint that swings from
    target to target, or a stated posture that does not reach its target, is refused with its line.
    Predicted errors are stated as `elastocal certificate` states them: in the frame of the declared base, or, where the base is
    unknown, in the robot's own frame after its best placement over the campaign's poses.
    """
    import numpy as np
    from rich.console import Console

    from elastocal.application.accuracy import (
        accuracy_sentence,
        before_m,
        campaign_accuracy,
        error_rows,
        millimetres,
        predict_errors,
    )
    from elastocal.application.calibrated import OperatingConditions, assumptions, beyond_fitted, regressed
    from elastocal.application.compensation import find_joint_targets
    from elastocal.application.frames import root_mean_square
    from elastocal.diagnosis.misplaced import point_sentence
    from elastocal.exchange.controllers import axes_of, check_name, controller_of, targets_of
    from elastocal.exchange.target_path import NO_BOUND, OK, read_target_path_of
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.data_frames import write_csv

    console = Console(stderr=True)
    controller = controller_of(language, "") if language else None
    if output.suffix != ".csv":
        raise InputError("--output", "", repr(output.name), "a name that ends in .csv; --format writes a program beside it")
    if axes and controller is None:
        raise InputError("--axes", "", repr(axes), "with --format")
    files = [output, *([output.with_suffix(controller.suffix)] if controller else [])]
    name = check_name(controller, files[-1]) if controller else ""
    check_places(*files)
    if not output.parent.is_dir():
        raise InputError(output, "", "no such folder", "a file in a folder that is there")
    campaign = diagnosed_campaign(folder)
    campaign = campaign.by_physics() if physics_only else campaign
    calibrated = campaign.calibrated
    prismatic = calibrated.robot.chain.prismatic
    named = axes_of(controller, prismatic, axes) if controller else ()
    wanted = read_target_path_of(path, calibrated.robot)
    operating = OperatingConditions(wanted.wrench, wanted.approach, wanted.time_s, wanted.temperature_c)
    print_lines((f"assumed: {line}" for line in assumptions(calibrated, operating)), console)
    with console.status("correcting"):
        found = find_joint_targets(calibrated, wanted.position, wanted.rotation, operating, wanted.start)
    good = found.status == OK
    if not good.all() and not partial:
        rows = first_names([f"line {wanted.lines[row]} is {found.status[row]}" for row in (~good).nonzero()[0]], _NAMED)
        reached = "poses that the robot reaches within its limits, in the posture that q1..qn state if any, or --partial"
        raise InputError(path, "", rows, reached)
    if controller and not good.any():
        raise InputError(path, "", "no pose that the robot reaches", "one at least, for a program")
    swings = _swings(wanted, found, good, calibrated.robot)
    if swings and not allow_large_steps:
        more = f" and {counted(len(swings) - 1, 'more large step')}" if len(swings) > 1 else ""
        raise InputError(path, "", swings[0] + more, "targets between, another posture, or --allow-large-steps")
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    outside, loaded = beyond_fitted(calibrated, found.joint_angles, wrench)
    beyond, heavy = outside | loaded, beyond_fitted(calibrated, found.joint_angles, wrench, _LOADS_BOUNDED)[1]
    bounded = good & ~outside & ~heavy
    status = found.status.astype(object)
    status[good & outside] = f"{NO_BOUND}joints outside the fitted range"
    status[good & heavy] = f"{NO_BOUND}loads beyond {_LOADS_BOUNDED:g} times the measured ones"
    errors = predict_errors(calibrated, found.joint_angles, operating)
    before = before_m(calibrated, wanted.position, wanted.rotation, found.error_before)
    with write_together(output.parent, [file.name for file in files]) as folder_of_all:
        write_csv(folder_of_all / output.name, _joint_targets(wanted, wrench, found, before, errors, beyond, status))
        if controller:
            targets = targets_of(found.joint_angles[good], prismatic, named)
            write_text(folder_of_all / files[1].name, controller.program(name, targets, _notes(campaign, wrench[good])))
    share = f"{grouped(good.sum())} of {counted(len(good), 'target')}"
    stated, lines = [], []
    if bounded.any():
        known = errors if bounded.all() else predict_errors(calibrated, found.joint_angles[bounded], operating.part(bounded))
        accuracy = known.accuracy("the targets" if bounded[good].all() else "the targets with a bound")
        stated.append((accuracy, root_mean_square(before[bounded])))
        lines.append(accuracy_sentence(accuracy))
    table = error_rows(campaign.verdict, *stated)
    lines = [*(f"{where}: {off} uncorrected, {after} corrected" for where, off, after in table), *lines]
    if good.any():
        lines += [accuracy_sentence(campaign_accuracy(calibrated)), point_sentence(campaign.case.campaign)]
    if calibrated.remainder is not None:
        added = np.linalg.norm(regressed(calibrated, found.joint_angles[good], operating.part(good)), axis=1)
        size = f"{millimetres(root_mean_square(added[added > 0.0]))} RMS" if added.any() else "nothing"
        acts = f"{grouped((added > 0.0).sum())} of {counted(len(added), 'target')}"
        words = campaign.verdict["remainder"]["words"]
        lines.append(f"a {words} on what the model leaves corrects {acts} by {size}; --physics-only leaves it out")
    if controller:
        called = ", ".join(f"q{number} as {axis}" for number, axis in enumerate(named, 1))
        lines.append(f"{files[1].name} goes to {share}: {controller.words}, {called}")
    alarms = [*(each["sentence"] for each in campaign.verdict["misplaced"])]
    if swings:
        alarms.append(first_names(swings, _NAMED))
    if unbounded := int((good & ~bounded).sum()):
        what = f"{_LOADS_BOUNDED:g} times the measured loads or outside the fitted range of joints"
        alarms.append(f"no bound is stated for {grouped(unbounded)} of {counted(int(good.sum()), 'target')}: beyond {what}")
    if beyond.any():
        some = f"{grouped(beyond.sum())} of {counted(len(beyond), 'target')}"
        alarms.append(f"{some} lie beyond the poses or loads of the campaign: their predicted errors are extrapolated")
    lines += [*(f"! {alarm}" for alarm in alarms), *map(str, files)]
    print_answer(good.all(), f"{share} corrected", lines, f"elastocal certificate {folder} --tolerance 0.2mm", console)


def _swings(wanted: TargetPath, found: Correction, good: np.ndarray, robot: Robot) -> list[str]:
    """A line for each joint that moves farther from one reached target to the next than `allowed_steps`."""
    from elastocal.application.compensation import large_steps

    lines = [wanted.lines[row] for row in good.nonzero()[0]]
    return [
        f"line {lines[row]}: joint {joint + 1} shifts by {1e3 * step:.0f} mm, {1e3 * most:.0f} allowed"
        if robot.chain.prismatic[joint]
        else f"line {lines[row]}: joint {joint + 1} turns by {math.degrees(step):.1f} degrees, {math.degrees(most):.1f} allowed"
        for row, joint, step, most in large_steps(robot, wanted.position[good], wanted.rotation[good], found.joint_angles[good])
    ]


def _notes(campaign: Diagnosed, wrench: np.ndarray) -> list[str]:
    """For what a program holds: robot, campaign, day, loads (N, 6) and tool, one line each."""
    from datetime import date

    end = campaign.calibrated.robot.chain.end_effector
    force, moment = (math.sqrt((part**2).sum(axis=1).max()) for part in (wrench[:, :3], wrench[:, 3:]))
    load = f"force up to {force:.4g} N, moment up to {moment:.4g} N m"
    return [
        f"robot: {campaign.calibrated.robot.name}",
        f"campaign: {campaign.name}",
        f"date: {date.today().isoformat()}",
        f"load: {load if force or moment else 'none beside what the robot file states'}",
        f"tool: {end.name}, target offset {', '.join(f'{1e3 * value:.4g}' for value in end.offset_m)} mm",
    ]


def _joint_targets(
    wanted: TargetPath,
    wrench: np.ndarray,
    found: Correction,
    before: np.ndarray,
    errors: Prediction,
    beyond: np.ndarray,
    status: np.ndarray,
) -> pd.DataFrame:
    """The file of joint targets: wanted poses, loads, commands q1..qn (rad, as the controller reports them), errors, status.

    `before` (N,) is what uncorrected targets would be missed by, m; `beyond` whether each lies beyond what was measured.
    """
    import numpy as np
    import pandas as pd
    from scipy.spatial.transform import Rotation

    from elastocal.exchange.target_path import NO_BOUND
    from elastocal.mechanics.components import WRENCH_NAMES

    pose = np.column_stack([wanted.position, Rotation.from_matrix(wanted.rotation).as_rotvec()])
    columns = dict(zip(("x", "y", "z", "rx", "ry", "rz"), pose.T, strict=True)) | dict(zip(WRENCH_NAMES, wrench.T, strict=True))
    angles = {f"q{joint}": column for joint, column in enumerate(found.joint_angles.T, 1)}
    nominal = {f"q{joint}_uncorrected": column for joint, column in enumerate(found.uncorrected.T, 1)}
    stated = {
        "predicted_error_before_m": before,
        "predicted_error_after_m": errors.error_m,
        "predicted_bound_m": np.where([each.startswith(NO_BOUND) for each in status], np.nan, errors.bound_m),
        "predicted_std_m": np.sqrt(errors.parameters_m**2 + errors.repeated_m**2 + errors.regression_m**2),
        "predicted_rotation_before_rad": np.linalg.norm(found.error_before[:, 3:], axis=1),
        "predicted_rotation_std_rad": errors.std_rad,
        "repeatability_m": errors.repeated_m,
        "outside_range": beyond,
    }
    return pd.DataFrame(angles | stated | {"status": status} | columns | nominal)
