"""Verify a corrected robot against measurements at its corrected targets, and join these
measurements to the campaign for another diagnosis."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal import __version__
from elastocal.application.accuracy import predict_determined_rms_m
from elastocal.application.frames import ROBOT, root_mean_square
from elastocal.application.statements import format_millimetres
from elastocal.application.verification import (
    CommandedTargets,
    add_noise_to_bound,
    compare_targets,
    compute_measured_errors,
    list_verification_shortfalls,
)
from elastocal.campaigns.campaign import DOCUMENT, ROBOT_FILE, average_by_group
from elastocal.campaigns.holdout import list_poses, number_configurations
from elastocal.campaigns.measurements import (
    CONDITIONS,
    CSV,
    ROTATION,
    convert_column,
    describe_columns,
    read_measurements,
)
from elastocal.campaigns.numbers import list_required_columns
from elastocal.campaigns.writing import copy_robot_file, write_campaign
from elastocal.errors import InputError
from elastocal.exchange.measured_targets import (
    CorrectedTargets,
    TargetMeasurements,
    read_corrected_targets,
    read_target_measurements,
)
from elastocal.io.records import compute_sha256
from elastocal.loop.loading import read_described_campaign
from elastocal.measuring.channels import parse_measuring
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.validation.conformity import PASS, UNDECIDED, decide_conformity

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from elastocal.application.calibrated import CalibratedRobot
    from elastocal.application.verification import MeasuredErrors, TargetComparison
    from elastocal.campaigns.campaign import Campaign, Measurements, Target
    from elastocal.campaigns.campaign_folder import CampaignFolder
    from elastocal.loop.calibrated_files import DiagnosedCampaign
    from elastocal.mechanics.robot import Robot

# Name of the table that `elastocal correct` writes, beside the measurements.
TARGETS = "targets.csv"
# End of the name of a campaign with the measurements of a verification.
_ROUND = re.compile(r"(.+)_round(\d+)")
# Largest relative difference of a stated error from that of the present diagnosis that
# is rounding.
_SAME_ERROR = 1e-3
# Share of the measured RMS error in the base frame that a placement must leave at most,
# so that the frame is suspected instead of the robot.
_FRAME_SHARE = 0.5


@dataclass(frozen=True)
class Verification:
    """A verified robot.

    Attributes
    ----------
    document : contents of verification.json.
    table : one row for each target.
    """

    document: dict[str, Any]
    table: pd.DataFrame

    def __repr__(self) -> str:
        errors = ", ".join(
            f"{name} {format_millimetres(self.document[f'{name}_rms_m'])}"
            for name in ("before", "predicted", "measured")
        )
        held = "held" if self.document["prediction"]["held"] else "did not hold"
        return (
            f"<Verification of {self.document['targets']} targets: RMS position error"
            f" {errors}; the prediction {held}>"
        )


def read_verification(
    path: Path, targets_path: Path, campaign: Campaign, lengths: str | None
) -> tuple[CorrectedTargets, TargetMeasurements]:
    """Read corrected targets and what was measured at them.

    Parameters
    ----------
    path, targets_path : files of the measurements and of the targets.
    campaign : the campaign by which the targets were corrected.
    lengths : unit of lengths whose header states none; None for metres.
    """
    robot = campaign.robot
    targets = read_corrected_targets(targets_path, robot.commands)
    names = list_reflectors(campaign.targets, robot, path)
    measured = read_target_measurements(path, targets, robot, names, lengths or "m")
    return targets, measured


def list_reflectors(
    targets: Sequence[Target], robot: Robot, source: str | Path
) -> list[str]:
    """List the targets on the end effector, those at a stated offset first.

    Raises `InputError`, which names `source`, if there is none.
    """
    end = robot.chain.end_effector.name
    at_end = [target for target in targets if target.point == end]
    if not at_end:
        allowed = f"a campaign with a target on {end}, the point that is corrected"
        raise InputError(source, "", "measurements of another point", allowed)
    at_end.sort(key=lambda target: target.offset_m is None)
    return [target.name for target in at_end]


def verify_campaign(
    campaign: DiagnosedCampaign,
    targets: CorrectedTargets,
    measured: TargetMeasurements,
    files: dict[str, Path],
    tolerance_m: float | None,
    accepted_risk: float,
) -> Verification:
    """Compare the measured errors of a corrected robot with the predicted ones.

    Parameters
    ----------
    campaign : the campaign by which the targets were corrected.
    targets, measured : as `read_verification` returns them.
    files : the files of both, by their roles, for their digests.
    tolerance_m : largest allowed RMS position error, m; None if nothing is certified.
    accepted_risk : accepted probability of a wrong decision.
    """
    robot = campaign.calibrated.robot
    verified = verify_robot(
        campaign.calibrated, targets, measured, tolerance_m, accepted_risk
    )
    document = {
        "campaign": campaign.name,
        "robot": robot.name,
        "serial": campaign.folder.document.get("serial_number", ""),
        "date": date.today().isoformat(),
        "version": __version__,
        "origin": campaign.origin,
        "files": campaign.folder.digests
        | {role: compute_sha256(path) for role, path in files.items()},
    }
    return Verification(document | verified.document, verified.table)


def verify_robot(
    calibrated: CalibratedRobot,
    targets: CorrectedTargets,
    measured: TargetMeasurements,
    tolerance_m: float | None,
    accepted_risk: float,
) -> Verification:
    """Compare the measured errors of a corrected robot with the predicted ones, as
    `verify_campaign`; the document has the errors, the tests and the certificate.

    `calibrated` is the robot with its whole fit.
    """
    target = _choose_target(calibrated, measured)
    robot = calibrated.robot
    commanded = _average_measurements(robot, targets, measured, target.name)
    comparison = compare_targets(
        calibrated, commanded, _relate_to_end_effector(target, calibrated)
    )
    certificate = None
    if tolerance_m is not None:
        certificate = _certify(comparison, tolerance_m, accepted_risk)
    document = (
        {
            "target": target.name,
            "offset_fitted": target.offset_m is None,
            "not_measured": int(targets.usable.sum()) - len(commanded),
        }
        | _describe_errors(comparison, accepted_risk)
        | {"certificate": certificate}
    )
    return Verification(document, _tabulate(comparison))


def _certify(
    comparison: TargetComparison, tolerance_m: float, accepted_risk: float
) -> dict[str, Any]:
    """Decide on a tolerance by the measured and by the predicted errors of the same
    targets."""
    measured = decide_conformity(comparison.measured_rms_m, tolerance_m, accepted_risk)
    shortfalls = list_verification_shortfalls(comparison.targets, comparison.errors)
    if shortfalls and measured.decision == PASS:
        measured = replace(measured, decision=UNDECIDED)
    commands = comparison.targets.joint_angles, comparison.targets.wrench
    predicted = decide_conformity(
        comparison.now.rms_m,
        tolerance_m,
        accepted_risk,
        predict_determined_rms_m(comparison.calibrated, *commands),
    )
    return {
        "predicted": asdict(predicted),
        "measured": asdict(measured),
        "shortfalls": shortfalls,
    }


def _describe_errors(
    comparison: TargetComparison, accepted_risk: float
) -> dict[str, Any]:
    """Return the errors of a verification as part of its document."""
    targets = comparison.targets
    distance_m = comparison.errors.distance_m
    worst = int(np.argmax(distance_m))
    frame = comparison.calibrated.scope.frame
    noise = comparison.calibrated.noise
    measured_rms_m = comparison.measured_rms_m
    return {
        "frame": frame,
        "targets": len(targets),
        "measurements": int(targets.repeats.sum()),
        "configurations": int(targets.configuration.max()) + 1,
        "before_rms_m": root_mean_square(targets.before_m),
        "predicted_rms_m": root_mean_square(targets.after_m),
        "measured_rms_m": root_mean_square(distance_m),
        "robot_rms_m": comparison.errors.compute_rms_without_noise_m(
            comparison.subtracted_m
        ),
        "robot_bound_m": float(np.quantile(measured_rms_m, 1.0 - accepted_risk)),
        "accepted_risk": accepted_risk,
        "worst": {
            "number": int(targets.number[worst]),
            "error_m": float(distance_m[worst]),
        },
        "noise": {
            "source": noise.source,
            "position_m": noise.position_m,
            "rms_m": float(np.sqrt(3.0 * (comparison.sensor_m**2).mean())),
        },
        "prediction": asdict(comparison.prediction),
        "remaining": asdict(comparison.remaining),
        "remarks": [
            *_remark_on_targets(targets, comparison.now.error_m),
            *_remark_on_frame(targets, comparison.errors, frame),
        ],
    }


def get_targets(calibrated: CalibratedRobot) -> dict[str, Target]:
    """Get the targets of the campaign behind a robot, by name."""
    assert calibrated.fit is not None, "a robot without a campaign has no targets"
    return {target.name: target for target in calibrated.fit.model.targets}


def _choose_target(calibrated: CalibratedRobot, measured: TargetMeasurements) -> Target:
    """Choose the target on the end effector whose errors are stated."""
    present = set(measured.target.tolist())
    targets = get_targets(calibrated)
    names = list_reflectors([*targets.values()], calibrated.robot, "measured")
    return next(targets[name] for name in names if name in present)


def _relate_to_end_effector(
    target: Target, calibrated: CalibratedRobot
) -> tuple[float, ...] | None:
    """Return the offset of a target from the corrected point, in its frame, as the
    diagnosis has estimated it; None if the campaign does not declare it."""
    if target.offset_m is None:
        return None
    assert calibrated.fit is not None, "a robot without a campaign has no targets"
    number = [*get_targets(calibrated)].index(target.name)
    offset_m = calibrated.fit.estimate.target_offset[number]
    point = calibrated.robot.chain.end_effector.offset_m
    return tuple((offset_m - np.array(point)).tolist())


def _average_measurements(
    robot: Robot, targets: CorrectedTargets, measured: TargetMeasurements, name: str
) -> CommandedTargets:
    """Average the repeated measurements of one reflector at each target."""
    selected = measured.select(measured.target == name)
    row, group = np.unique(selected.row, return_inverse=True)
    commanded = targets.select(row)
    model_angles = robot.model_angles(commanded.joint_angles)
    return CommandedTargets(
        **vars(commanded),
        number=row + 1,
        measured=average_by_group(selected.position, group),
        repeats=np.bincount(group),
        configuration=number_configurations(model_angles, np.arange(len(row))),
    )


def _remark_on_targets(targets: CommandedTargets, error_m: np.ndarray) -> list[str]:
    """Remark that the targets were corrected by another diagnosis than the present."""
    same = np.isclose(targets.after_m, error_m, rtol=_SAME_ERROR, atol=1e-9)
    if same.all():
        return []
    return [
        "the targets were corrected by another diagnosis of this campaign or another"
        " version: the test refers to the present one"
    ]


def _remark_on_frame(
    targets: CommandedTargets, errors: MeasuredErrors, frame: str
) -> list[str]:
    """Remark that most of the measured error is that of the base frame."""
    if frame == ROBOT:
        return []
    placed = compute_measured_errors(
        replace(targets, measured=targets.position + errors.error),
        (0.0, 0.0, 0.0),
        base_known=False,
    )
    rms_m = root_mean_square(errors.distance_m)
    placed_m = root_mean_square(placed.distance_m)
    if placed_m > _FRAME_SHARE * rms_m:
        return []
    return [
        f"after the best placement of the base {1e3 * placed_m:.3f} mm of the measured"
        f" {1e3 * rms_m:.3f} mm remain: the tracker's frame is not that of the campaign,"
        " or the diagnosis has placed the base inexactly"
    ]


def _tabulate(comparison: TargetComparison) -> pd.DataFrame:
    """Tabulate predicted and measured errors by target."""
    import pandas as pd

    targets = comparison.targets
    errors = comparison.errors
    bound_m = add_noise_to_bound(targets.bound_m, comparison.sensor_m)
    return pd.DataFrame(
        {
            "target": targets.number,
            "x": targets.position[:, 0],
            "y": targets.position[:, 1],
            "z": targets.position[:, 2],
            "predicted_error_before_m": targets.before_m,
            "predicted_error_after_m": targets.after_m,
            "predicted_bound_m": targets.bound_m,
            "bound_with_noise_m": bound_m,
            "measured_error_m": errors.distance_m,
            "measured_dx_m": errors.error[:, 0],
            "measured_dy_m": errors.error[:, 1],
            "measured_dz_m": errors.error[:, 2],
            "measurements": targets.repeats,
        }
    )


def name_next_round(folder: CampaignFolder) -> tuple[Path, str]:
    """Return folder and name of the campaign of the next round: cell_round2 beside cell,
    and cell_round3 after that."""
    match = _ROUND.fullmatch(folder.name)
    stem, number = (match[1], int(match[2])) if match else (folder.name, 1)
    name = f"{stem}_round{number + 1}"
    return folder.path.resolve().parent / name, name


def list_round_files(folder: CampaignFolder, output: Path) -> list[Path]:
    """List the files that `join_measurements` writes."""
    names = [DOCUMENT, CSV]
    if not _is_named_robot(folder):
        names.append(ROBOT_FILE)
    return [output / name for name in names]


def _is_named_robot(folder: CampaignFolder) -> bool:
    """Whether the robot of a campaign is one of the project's."""
    return folder.robot_file.parent == folder.robots_folder


def join_measurements(
    folder: CampaignFolder,
    targets: CorrectedTargets,
    measured: TargetMeasurements,
    output: Path,
    name: str,
) -> list[str]:
    """Write a campaign that has the measurements of a campaign and, as a further session,
    those of its corrected robot.

    In a campaign in the tracker's frame each session has a frame of its own. The first
    measurements under load identify the compliances, as a plan with loads does.

    Parameters
    ----------
    folder : the campaign, which stays as it is.
    targets, measured : as `read_verification` returns them.
    output : folder of the new campaign.
    name : its name.

    Returns
    -------
    Remarks on columns that were left out, and on compliances.
    """
    _, campaign = read_described_campaign(folder)
    if campaign.measures_poses and measured.rotation_vector is None:
        allowed = "rx, ry, rz or another orientation: this campaign measures poses"
        raise InputError(folder.source, "measured", "no measured orientations", allowed)
    before = campaign.measurements
    columns = _read_columns(folder)
    session = int(before.session.max()) + 1
    further = _tabulate_session(campaign, targets, measured, session)
    remarks = []
    for condition in CONDITIONS:
        if condition in columns and condition not in further:
            remarks.append(
                f"{condition} is left out: the new measurements do not have it"
            )
            del columns[condition]
    table = {
        column: np.concatenate([values, further[column]])
        for column, values in columns.items()
    }
    document = dict(folder.document) | {"campaign": name}
    document["holdout"] = _number_held_out_poses(folder.holdout, before)
    is_nominal = document.get("compliance", "nominal") == "nominal"
    if is_nominal and not before.wrench.any() and further["load"].any():
        document["compliance"] = "identify"
        remarks.append(
            "compliance: identify, because these are the first measurements under load"
        )
    if not _is_named_robot(folder):
        document["robot"] = ROBOT_FILE
        # The robot file comes first, because a folder with a campaign.yaml needs it.
        copy_robot_file(folder.robot_file, output)
    write_campaign(output, document, table, campaign.robot.commands, kind="csv")
    return remarks


def _read_columns(folder: CampaignFolder) -> dict[str, np.ndarray]:
    """Read the columns of a campaign's measurements as they are in its file."""
    joints = folder.robot.commands
    plan = parse_measuring(folder.document, folder.source)
    cells = read_measurements(folder.path, joints, list_required_columns(plan))
    unread = () if plan.has_orientations else ROTATION
    columns = {
        name: convert_column(cells, column)
        for name, column in describe_columns(joints).items()
        if name in cells.columns and name not in unread
    }
    count = len(cells.rows)
    columns.setdefault("session", np.zeros(count, int))
    for name in WRENCH_NAMES:
        columns.setdefault(name, np.zeros(count))
    return columns


def _tabulate_session(
    campaign: Campaign,
    targets: CorrectedTargets,
    measured: TargetMeasurements,
    session: int,
) -> dict[str, np.ndarray]:
    """Tabulate measurements at corrected targets as a session of a campaign."""
    count = len(measured)
    row = measured.row
    wrench = targets.wrench[row]
    columns: dict[str, np.ndarray] = {
        "session": np.full(count, session),
        "pose": row + 1,
        "load": wrench.any(axis=1).astype(int),
        "repeat": measured.repeat,
        "target": measured.target,
    }
    for joint, angles in enumerate(targets.joint_angles[row].T, 1):
        columns[f"q{joint}"] = angles
        # The direction of approach is unknown.
        columns[f"approach{joint}"] = np.zeros(count)
    columns |= dict(zip(WRENCH_NAMES, wrench.T, strict=True))
    columns |= dict(zip("xyz", measured.position.T, strict=True))
    if campaign.measures_poses and measured.rotation_vector is not None:
        vectors = measured.rotation_vector
        columns |= dict(zip(ROTATION, vectors.T, strict=True))
    return columns | measured.conditions


def _number_held_out_poses(
    holdout: dict[str, Any], before: Measurements
) -> dict[str, Any]:
    """Return the rule of the held-out poses for a campaign with one more session: poses
    that it names get each session in which they were measured."""
    if "poses" not in holdout:
        return holdout
    labels, _ = list_poses(before)
    poses = []
    for entry in holdout["poses"]:
        if isinstance(entry, list):
            poses.append(entry)
        else:
            poses += labels[labels[:, 1] == entry].tolist()
    return {"poses": poses}
