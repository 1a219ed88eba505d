"""`elastocal export`: the calibrated robot as a robot file, a URDF, the model file and
the files of other programs."""

from __future__ import annotations

import math
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from elastocal import evaluators
from elastocal.command.terminal import (
    ForceOption,
    find_workplace,
    load_diagnosed_campaign,
    print_answer,
)
from elastocal.counting import format_count
from elastocal.errors import InputError

if TYPE_CHECKING:
    import numpy as np

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.application.exported import FoldedRobot
    from elastocal.exchange.urdf_writing import CorrectedUrdf
    from elastocal.loop.calibrated_files import DiagnosedCampaign

ROBOT = "robot.yaml"
URDF = "robot.urdf"
MODEL = "robot.elastocal.json"
MJCF = "robot.xml"
KINEMATICS = "kinematics.yaml"
SCHEMA = "model.schema.json"
EVALUATORS = ("elastocal_model.py", "elastocal_model.hpp")
# Files of each further format.
FORMATS = {"model": (MODEL,), "evaluators": (*EVALUATORS, SCHEMA), "mjcf": (MJCF,)}
# Smaller deviations of the URDF are rounding and are not mentioned.
_ROUNDING_MM = 1e-5


def export(
    folder: Annotated[Path, Argument(help="Folder of a diagnosed campaign.")],
    *,
    output: Annotated[Path, Option(help="Folder for the files.")],
    urdf: Annotated[
        Path | None,
        Option(
            help="The URDF that the robot was imported from. Its joint origins are"
            " changed, nothing else."
        ),
    ] = None,
    formats: Annotated[
        list[str] | None,
        Option(
            "--format",
            help="Write more: model (the whole model as JSON), evaluators (programs that"
            " evaluate it without elastocal), mjcf (MuJoCo). May be repeated.",
        ),
    ] = None,
    kinematics: Annotated[
        Path | None,
        Option(
            help="Kinematics file of the same robot: calibration.yaml of Universal Robots,"
            " or kinematics.yaml of Franka. It is written again with calibrated frames."
        ),
    ] = None,
    force: ForceOption = False,
) -> None:
    """Write the calibrated robot: as a robot file, and as the URDF that it came from.

    A robot file holds geometry, joint compliances and weights, a URDF the geometry
    alone. Neither holds other effects or the regression on the residual: the command
    prints the accuracy that is lost without them. Existing files are replaced only if a
    command of elastocal has written them.
    """
    from rich.console import Console

    from elastocal.application.accuracy import predict_campaign_accuracy
    from elastocal.application.exported import (
        compute_urdf_deviation_m,
        compute_urdf_poses,
        fold_effects,
        write_robot_file,
    )
    from elastocal.application.statements import format_accuracy
    from elastocal.exchange.urdf_writing import write_calibrated_origins
    from elastocal.io.atomic_writes import write_together
    from elastocal.io.replacement import check_replaceable, note_written_files

    further = _FurtherFiles(tuple(formats or ()), kinematics)
    names = [ROBOT, URDF, *further.list_names()]
    files = [output / name for name in names]
    campaign = load_diagnosed_campaign(folder)
    inputs: list[str | Path] = [*campaign.folder.files()]
    inputs += [path for path in (urdf, kinematics) if path is not None]
    check_replaceable(files, inputs, find_workplace(), force=force)
    # No file can hold the regression, so the files are of the robot without it.
    calibrated = campaign.without_regression().calibrated
    folded = fold_effects(calibrated)
    states = campaign.case.observations.states
    commands = calibrated.robot.reported_angles(states.joint_angles)
    details = _describe_losses(campaign, calibrated, folded, commands, states.wrench)
    accuracy = predict_campaign_accuracy(calibrated)
    details += [format_accuracy(accuracy), str(output / ROBOT)]
    corrected = None
    if urdf is not None:
        corrected = write_calibrated_origins(urdf, calibrated.robot, folded.robot)
    with write_together(output, names) as partial:
        write_robot_file(partial / ROBOT, folded, campaign.name)
        details += further.write(campaign, partial, output)
        if corrected is not None:
            (partial / URDF).write_bytes(corrected.content)
            urdf_poses = compute_urdf_poses(
                corrected, partial / URDF, calibrated.robot, commands
            )
            deviation_m = compute_urdf_deviation_m(
                urdf_poses[0], folded.robot, commands
            )
            details += [
                str(output / URDF),
                *_describe_urdf(corrected, deviation_m),
                _describe_urdf_error(
                    calibrated, urdf_poses, commands, states.wrench, accuracy.rms_m
                ),
            ]
    note_written_files(files, find_workplace())
    print_answer(
        f"{campaign.name}: calibrated robot in {output}",
        details,
        "",
        Console(stderr=True),
    )


@dataclass(frozen=True)
class _FurtherFiles:
    """Files beside the robot file and the URDF.

    Attributes
    ----------
    formats : keys of `FORMATS`.
    kinematics : kinematics file of the maker; None if none is written.
    """

    formats: tuple[str, ...]
    kinematics: Path | None

    def list_names(self) -> list[str]:
        """List the names of the files; raises `InputError` for an unknown format."""
        unknown = [name for name in self.formats if name not in FORMATS]
        if unknown:
            raise InputError("--format", "", repr(unknown[0]), ", ".join(FORMATS))
        names = [name for key in dict.fromkeys(self.formats) for name in FORMATS[key]]
        return names if self.kinematics is None else [*names, KINEMATICS]

    def write(
        self, campaign: DiagnosedCampaign, folder: Path, output: Path
    ) -> list[str]:
        """Write the files to a folder; return what they lack and where they will be."""
        from elastocal.application.model_file import build_model_schema
        from elastocal.interface.corrected_robot import CorrectedRobot
        from elastocal.io.json_files import write_json
        from elastocal.report.words import format_candidate, join_items

        robot = CorrectedRobot(campaign.calibrated, campaign.verdict)
        details = []
        if "model" in self.formats:
            robot.save(folder / MODEL)
        if "evaluators" in self.formats:
            sources = Path(evaluators.__path__[0])
            for name in EVALUATORS:
                shutil.copyfile(sources / name, folder / name)
            write_json(folder / SCHEMA, build_model_schema())
        if "mjcf" in self.formats:
            left_out = robot.to_mjcf(folder / MJCF)
            if left_out:
                effects = join_items(map(format_candidate, left_out))
                details.append(f"! {MJCF} does not hold {effects}")
        if self.kinematics is not None:
            deviation_m = robot.to_kinematics_file(folder / KINEMATICS, self.kinematics)
            details.append(
                f"{KINEMATICS} deviates from the calibrated geometry by up to"
                f" {1e3 * deviation_m:.4f} mm"
            )
        return [*details, *(str(output / name) for name in self.list_names())]


def _describe_losses(
    campaign: DiagnosedCampaign,
    exported: CalibratedRobot,
    folded: FoldedRobot,
    reported_angles: np.ndarray,
    wrench: np.ndarray,
) -> list[str]:
    """Warn of the regression and of the effects that no file can hold.

    Parameters
    ----------
    campaign : gives the regression.
    exported : the robot without it.
    folded : contents of the robot file.
    reported_angles, wrench : (N, n) commands, rad, and (N, 6) loads, N and N m, at which
        the losses are measured.
    """
    import numpy as np

    from elastocal.application.calibrated import predict_residual_displacements
    from elastocal.application.exported import compute_left_out_displacements_m
    from elastocal.report.words import format_candidate, join_items

    warnings = []
    calibrated = campaign.calibrated
    remainder = campaign.verdict.remainder
    if remainder and calibrated.residual_model:
        displacements = predict_residual_displacements(
            calibrated, reported_angles, wrench
        )
        size = _format_size(np.linalg.norm(displacements, axis=1))
        warnings.append(
            f"! no file holds the {remainder.words} on the residual,"
            f" which elastocal correct adds: {size}"
        )
    if folded.left_out:
        effects = exported.model.effects
        names = join_items(
            format_candidate(effects[number].key) for number in folded.left_out
        )
        size = _format_size(
            compute_left_out_displacements_m(exported, reported_angles, wrench)
        )
        warnings.append(f"! no file holds {names}: {size}")
    return warnings


def _format_size(displacements_m: np.ndarray) -> str:
    """Format the lengths (N,) of displacements of the end effector."""
    rms_mm = 1e3 * float((displacements_m**2).mean()) ** 0.5
    largest_mm = 1e3 * displacements_m.max()
    return f"up to {largest_mm:.3f} mm at the measured poses ({rms_mm:.3f} mm RMS)"


def _describe_urdf(corrected: CorrectedUrdf, deviation_m: float) -> list[str]:
    """Say what was changed in the user's URDF, and how far it is from the robot file."""
    changed = format_count(corrected.changed, "joint origin")
    sentences = [
        f"{URDF}: {changed} changed, nothing else;"
        " put it where the old one is, beside its meshes"
    ]
    deviation_mm = 1e3 * deviation_m
    if deviation_mm > _ROUNDING_MM:
        sentences.append(
            f"{URDF} cannot hold ratios of joints, and errors behind a last joint that"
            " has no fixed one after it:"
            f" up to {deviation_mm:.3f} mm at the measured poses"
        )
    return sentences


def _describe_urdf_error(
    calibrated: CalibratedRobot,
    urdf_poses: tuple[np.ndarray, np.ndarray],
    reported_angles: np.ndarray,
    wrench: np.ndarray,
    corrected_m: float,
) -> str:
    """Say by how much a robot errs that is commanded by the URDF.

    Parameters
    ----------
    calibrated : the robot.
    urdf_poses : positions (N, 3), m, and rotations (N, 3, 3) of the URDF.
    reported_angles, wrench : (N, n) commands, rad, and (N, 6) loads, N and N m.
    corrected_m : RMS error of the calibrated robot itself.
    """
    from elastocal.application.calibrated import compute_nominal_poses
    from elastocal.application.exported import compute_file_error_m

    original_poses = compute_nominal_poses(calibrated.robot, reported_angles)
    urdf_m, original_m = (
        compute_file_error_m(calibrated, *poses, reported_angles, wrench)
        for poses in (urdf_poses, original_poses)
    )
    error_mm = 1e3 * math.hypot(urdf_m, corrected_m)
    original_mm = 1e3 * math.hypot(original_m, corrected_m)
    return (
        f"{URDF} alone: {error_mm:.3f} mm RMS at the measured poses and loads, where the"
        f" original errs by {original_mm:.3f} mm: a URDF holds no sag and no springs, and"
        " only corrected targets have the accuracy above"
    )
