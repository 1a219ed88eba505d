"""What a diagnosed campaign leads to: `elastocal correct`, `certificate` and
`export`."""

from __future__ import annotations

import math
import tempfile
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from elastocal.command.terminal import (
    length_m,
    load_diagnosed_campaign,
    print_answer,
    workplace,
)
from elastocal.counting import format_count, format_integer, list_first
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from elastocal.application.accuracy import Prediction
    from elastocal.application.compensation import Correction
    from elastocal.exchange.target_path import TargetPath
    from elastocal.exchange.urdf_writing import CorrectedUrdf
    from elastocal.loop.calibrated_files import Diagnosed
    from elastocal.mechanics.robot import Robot

DOCUMENT = "certificate.json"
PAGES = "certificate.pdf"
ROBOT, URDF = _EXPORTED = "robot.yaml", "robot.urdf"
_ROUNDING_MM = 1e-5
# Lines that a message names.
_NAMED = 5
# Loads beyond so many times the measured ones have no bound: stiffness that is fitted
# as a constant need not be one there.
_LOADS_BOUNDED = 2.0


def correct(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    path: Annotated[
        Path,
        Argument(
            help="CSV of wanted poses: x, y, z in m, rx, ry, rz in rad; fx..fz or fx..mz, q1..qn."
        ),
    ],
    output: Annotated[Path, Option(help="CSV of joint targets.")],
    language: Annotated[
        str,
        Option(
            "--format",
            help="Write a program beside the CSV too: krl (KUKA), rapid (ABB), tp (FANUC), urscript.",
        ),
    ] = "",
    axes: Annotated[
        str,
        Option(
            help="What the controller calls q1..qn, such as A1,A2,E1,A3,A4,A5,A6; needed where it is ambiguous."
        ),
    ] = "",
    allow_large_steps: Annotated[
        bool,
        Option(
            "--allow-large-steps",
            help="Accept joints that turn by more than 5 times what the path turns, and 10 degrees.",
        ),
    ] = False,
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
    import numpy as np
    from rich.console import Console

    from elastocal.application.accuracy import (
        before_m,
        format_accuracy,
        millimetres,
        predict_errors,
    )
    from elastocal.application.calibrated import beyond_fitted, regressed
    from elastocal.application.compensation import find_joint_targets
    from elastocal.application.frames import root_mean_square
    from elastocal.exchange.controllers import (
        axes_of,
        check_name,
        find_controller,
        targets_of,
    )
    from elastocal.exchange.target_path import NO_BOUND, OK, read_target_path_of
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.io.data_frames import write_csv

    console = Console(stderr=True)
    controller = find_controller(language) if language else None
    if output.suffix != ".csv":
        raise InputError(
            "--output",
            "",
            repr(output.name),
            "a name that ends in .csv; --format writes a program beside it",
        )
    if axes and controller is None:
        raise InputError("--axes", "", repr(axes), "with --format")
    files = [output, *([output.with_suffix(controller.suffix)] if controller else [])]
    name = check_name(controller, files[-1]) if controller else ""
    check_places(*files)
    if not output.parent.is_dir():
        raise InputError(
            output, "", "no such folder", "a file in a folder that is there"
        )
    campaign = load_diagnosed_campaign(folder)
    calibrated = campaign.calibrated
    robot = calibrated.robot
    named = axes_of(controller, robot.chain.prismatic, axes) if controller else ()
    wanted = read_target_path_of(path, robot)
    wrench = np.zeros((len(wanted), 6)) if wanted.wrench is None else wanted.wrench
    with console.status("correcting"):
        found = find_joint_targets(
            calibrated, wanted.position, wanted.rotation, wrench, wanted.start
        )
    if (failed := np.flatnonzero(found.status != OK)).size:
        rows = list_first(
            [f"line {wanted.lines[row]} is {found.status[row]}" for row in failed],
            _NAMED,
        )
        reached = "poses that the robot reaches within its limits, in the posture that q1..qn state if any"
        raise InputError(path, "", rows, reached)
    swings = _swings(wanted, found, robot)
    if swings and not allow_large_steps:
        raise InputError(
            path,
            "",
            list_first(swings, 1),
            "targets between, another posture, or --allow-large-steps",
        )
    outside, loaded = beyond_fitted(calibrated, found.joint_angles, wrench)
    heavy = beyond_fitted(calibrated, found.joint_angles, wrench, _LOADS_BOUNDED)[1]
    status = found.status.astype(object)
    status[outside] = f"{NO_BOUND}joints outside the fitted range"
    status[heavy] = f"{NO_BOUND}loads beyond {_LOADS_BOUNDED:g} times the measured ones"
    bounded = status == OK
    beyond = outside | loaded
    errors = predict_errors(calibrated, found.joint_angles, wrench, draws=0)
    before = before_m(calibrated, wanted.position, wanted.rotation, found.error_before)
    with write_together(output.parent, [file.name for file in files]) as partial:
        write_csv(
            partial / output.name,
            _joint_targets(wanted, wrench, found, before, errors, beyond, status),
        )
        if controller:
            targets = targets_of(found.joint_angles, robot.chain.prismatic, named)
            write_text(
                partial / files[1].name,
                controller.program(name, targets, _notes(campaign, wrench)),
            )
    lines = []
    if bounded.any():
        known = predict_errors(calibrated, found.joint_angles[bounded], wrench[bounded])
        accuracy = known.accuracy(
            "the targets" if bounded.all() else "the targets with a bound"
        )
        uncorrected = f"uncorrected they would be missed by {millimetres(root_mean_square(before[bounded]))} RMS"
        lines += [format_accuracy(accuracy), uncorrected]
    count = format_count(len(wanted), "target")
    if calibrated.remainder is not None:
        added = np.linalg.norm(
            regressed(calibrated, found.joint_angles, wrench), axis=1
        )
        size = (
            f"{millimetres(root_mean_square(added[added > 0.0]))} RMS"
            if added.any()
            else "nothing"
        )
        words = campaign.verdict["remainder"]["words"]
        lines.append(
            f"a {words} on what the model leaves corrects {format_integer((added > 0.0).sum())} of {count} by {size}"
        )
    if controller:
        called = ", ".join(
            f"q{number} as {axis}" for number, axis in enumerate(named, 1)
        )
        lines.append(
            f"{files[1].name} goes to all of them: {controller.words}, {called}"
        )
    alarms = [each["sentence"] for each in campaign.verdict["misplaced"]]
    if swings:
        alarms.append(list_first(swings, _NAMED))
    if not bounded.all():
        what = f"{_LOADS_BOUNDED:g} times the measured loads or outside the fitted range of joints"
        alarms.append(
            f"no bound is stated for {format_integer((~bounded).sum())} of {count}: beyond {what}"
        )
    if beyond.any():
        some = f"{format_integer(beyond.sum())} of {count} lie beyond the poses or loads of the campaign"
        alarms.append(f"{some}: their predicted errors are extrapolated")
    lines += [*(f"! {alarm}" for alarm in alarms), *map(str, files)]
    print_answer(
        True,
        f"{count} corrected",
        lines,
        f"elastocal certificate {folder} --tolerance 0.2mm",
        console,
    )


def _swings(wanted: TargetPath, found: Correction, robot: Robot) -> list[str]:
    """A line for each joint that moves farther from one target to the next than
    `allowed_steps`."""
    from elastocal.application.compensation import large_steps

    def words(row: int, joint: int, step: float, most: float) -> str:
        if robot.chain.prismatic[joint]:
            return f"line {wanted.lines[row]}: joint {joint + 1} shifts by {1e3 * step:.0f} mm, {1e3 * most:.0f} allowed"
        turns = f"turns by {math.degrees(step):.1f} degrees, {math.degrees(most):.1f} allowed"
        return f"line {wanted.lines[row]}: joint {joint + 1} {turns}"

    return [
        words(*step)
        for step in large_steps(
            robot, wanted.position, wanted.rotation, found.joint_angles
        )
    ]


def _notes(campaign: Diagnosed, wrench: np.ndarray) -> list[str]:
    """For what a program holds: robot, campaign, day, loads (N, 6) and tool, one line
    each."""
    end = campaign.calibrated.robot.chain.end_effector
    force, moment = (
        math.sqrt((part**2).sum(axis=1).max())
        for part in (wrench[:, :3], wrench[:, 3:])
    )
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
    """The file of joint targets: wanted poses, loads, commands q1..qn (rad, as the
    controller reports them), errors, status.

    `before` (N,) is what uncorrected targets would be missed by, m; `beyond` whether
    each lies beyond what was measured.
    """
    import numpy as np
    import pandas as pd
    from scipy.spatial.transform import Rotation

    from elastocal.exchange.target_path import NO_BOUND
    from elastocal.mechanics.components import WRENCH_NAMES

    pose = np.hstack(
        [wanted.position, Rotation.from_matrix(wanted.rotation).as_rotvec(), wrench]
    )
    commands = pd.DataFrame(found.joint_angles).rename(
        columns=lambda joint: f"q{joint + 1}"
    )
    nominal = pd.DataFrame(found.uncorrected).rename(
        columns=lambda joint: f"q{joint + 1}_uncorrected"
    )
    stated = {
        "predicted_error_before_m": before,
        "predicted_error_after_m": errors.error_m,
        "predicted_bound_m": np.where(
            [each.startswith(NO_BOUND) for each in status], np.nan, errors.bound_m
        ),
        "predicted_std_m": np.sqrt(
            errors.parameters_m**2 + errors.repeated_m**2 + errors.regression_m**2
        ),
        "repeatability_m": errors.repeated_m,
        "outside_range": beyond,
        "status": status,
    }
    asked = pd.DataFrame(pose, columns=["x", "y", "z", "rx", "ry", "rz", *WRENCH_NAMES])
    return pd.concat([commands, pd.DataFrame(stated), asked, nominal], axis=1)


def certificate(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    tolerance: Annotated[
        str, Option(help="Largest allowed RMS position error, such as 0.2mm.")
    ],
    risk: Annotated[
        float, Option(min=0.001, max=0.5, help="Accepted risk of a wrong decision.")
    ] = 0.05,
) -> None:
    """Certify a robot against a tolerance: pass, fail or undecided.

    The certificate has the risk of being wrong and the error budget, and says of which
    point it speaks. It stands beside the report. The exit code is 0 if the robot
    passes, and 1 if it fails or is undecided. A robot that nobody measured after
    correction is predicted to pass or fail.
    """
    from rich.console import Console

    from elastocal.data_checks.protocol import data_at_fault
    from elastocal.figures.loop import draw_budget_bars
    from elastocal.figures.style import save_all
    from elastocal.io.atomic_writes import check_places, write_together
    from elastocal.io.json_files import write_json
    from elastocal.loop.calibrated_files import certificate as certified
    from elastocal.report.certificate import certificate_facts
    from elastocal.report.typesetting import compile_document

    console = Console(stderr=True)
    limit = length_m("--tolerance", tolerance)
    found = load_diagnosed_campaign(folder)
    place = workplace() / "reports" / "loop" / found.name
    check_places(place / PAGES, place / DOCUMENT, top=workplace() / "reports")
    if data_at_fault(found.verdict):
        raise InputError(
            folder,
            "",
            "data at fault",
            "a campaign whose data are in order; its report says what is wrong",
        )
    with console.status("working"):
        document = certified(found, limit, risk)
        facts = certificate_facts(document)
        with (
            tempfile.TemporaryDirectory() as scratch,
            write_together(place, (PAGES, DOCUMENT)) as partial,
        ):
            names = [row[0] for row in facts["budget"]]
            budget = draw_budget_bars(
                document["budget"], names, limit, document["tracker_rms_m"]
            )
            pictures = save_all({"budget": budget}, scratch).values()
            compile_document(
                partial / PAGES, "certificate.typ", {"facts": facts}, pictures
            )
            write_json(partial / DOCUMENT, document)
    passed = facts["decision"] == "pass"
    answer = f"{facts['decision']}, as predicted: {facts['headline']}"
    details = [
        facts["decision_sentences"],
        facts["point"],
        *(f"! {each['sentence']}" for each in document["misplaced"]),
    ]
    print_answer(
        passed,
        answer,
        [*details, str(place / PAGES), str(place / DOCUMENT)],
        facts["now"],
        console,
    )
    raise typer.Exit(0 if passed else 1)


def export(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    output: Annotated[Path, Option(help="Folder for the files.")],
    urdf: Annotated[
        Path | None,
        Option(
            help="The URDF that the robot was imported from. Its joint origins are changed, nothing else."
        ),
    ] = None,
) -> None:
    """Write the calibrated robot: as a robot file, and as the URDF that it came from.

    A robot file holds geometry, springs and weights, a URDF the geometry alone. Neither
    holds other effects or the regression on the remainder: what is lost with them is
    said, and the accuracy stated is without the regression.
    """
    import numpy as np
    import yaml
    from rich.console import Console

    from elastocal.application.accuracy import (
        format_accuracy,
        predict_campaign_accuracy,
    )
    from elastocal.application.calibrated import regressed
    from elastocal.application.exported import find_left_out_m, fold_effects
    from elastocal.exchange.urdf_writing import write_calibrated_origins
    from elastocal.io.atomic_writes import check_places, write_text, write_together
    from elastocal.mechanics.robot_file import document_of

    check_places(*(output / name for name in _EXPORTED))
    if urdf is not None and (output / URDF).resolve() == urdf.resolve():
        raise InputError(
            urdf, "", "the file that would be replaced", "a URDF outside of --output"
        )
    whole = load_diagnosed_campaign(folder)
    # No file has the regression: what stands in them is of a robot without.
    calibrated = whole.by_physics().calibrated
    states = whole.case.observations.states
    nominal = calibrated.robot
    folded = fold_effects(calibrated)
    at = nominal.reported_angles(states.joint_angles)
    under = states.wrench
    lines = []
    if whole.calibrated.remainder is not None:
        words = whole.verdict["remainder"]["words"]
        lost = np.linalg.norm(regressed(whole.calibrated, at, under), axis=1)
        lines.append(
            f"! no file holds the {words} on the remainder, which elastocal correct adds: {_sizes(lost)}"
        )
    if folded.left_out:
        names = ", ".join(
            calibrated.model.effects[number].key for number in folded.left_out
        )
        lines.append(
            f"! no file holds {names}: {_sizes(find_left_out_m(calibrated, at, under))}"
        )
    lines += [
        format_accuracy(predict_campaign_accuracy(calibrated)),
        str(output / ROBOT),
    ]
    drop_in = (
        None if urdf is None else write_calibrated_origins(urdf, nominal, folded.robot)
    )
    text = yaml.safe_dump(
        document_of(folded.robot), sort_keys=False, default_flow_style=None, width=128
    )
    with write_together(output, _EXPORTED) as partial:
        write_text(
            partial / ROBOT,
            f"# Calibrated by elastocal from the campaign {whole.name}.\n{text}",
        )
        if drop_in is not None:
            (partial / URDF).write_bytes(drop_in.content)
            lines += [
                str(output / URDF),
                *_drop_in(drop_in, partial / URDF, nominal, folded.robot, at),
            ]
    print_answer(
        True,
        f"{whole.name}: calibrated robot in {output}",
        lines,
        "",
        Console(stderr=True),
    )


def _sizes(off: np.ndarray) -> str:
    """How far something moves the end effector (N,), m, in words."""
    return f"up to {1e3 * off.max():.3f} mm at the measured poses ({1e3 * float((off**2).mean()) ** 0.5:.3f} mm RMS)"


def _drop_in(
    drop_in: CorrectedUrdf,
    path: Path,
    nominal: Robot,
    robot: Robot,
    reported: np.ndarray,
) -> list[str]:
    """What became of the user's URDF, and how far it is from the robot file at reported
    angles (N, n)."""
    import numpy as np

    from elastocal.exchange.urdf import read_urdf
    from elastocal.exchange.urdf_writing import nominal_chain
    from elastocal.mechanics.kinematics import poses

    _, chain = nominal_chain(
        read_urdf(path), drop_in.base, drop_in.tip, path.as_posix()
    )
    theirs, _ = poses(chain, nominal.model_angles(reported), chain.end_effector)
    mine, _ = poses(robot.chain, robot.model_angles(reported), robot.chain.end_effector)
    off = 1e3 * float(np.linalg.norm(theirs - mine, axis=1).max())
    changed = format_count(drop_in.changed, "joint origin")
    lines = [
        f"{URDF}: {changed} changed, nothing else; put it where the old one is, beside its meshes"
    ]
    if off > _ROUNDING_MM:
        what = "ratios of joints, and errors behind a last joint that has no fixed one after it"
        lines.append(
            f"{URDF} cannot hold {what}: up to {off:.3f} mm at the measured poses"
        )
    return lines
