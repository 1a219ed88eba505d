"""A campaign's folder, read and checked before anything is fitted to it.

A campaign is a folder of ``campaign.yaml`` and ``measurements.csv`` or ``measurements.parquet``, one row for each measurement
of one target. All that is wrong on its face is refused here, in one line; a unit that only a fit can show to be
wrong is left for the diagnosis to trace.
"""

import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import (
    DEFAULT_HOLDOUT,
    DOCUMENT,
    Campaign,
    Measurements,
    Target,
    assemble_campaign,
    targets_from,
)
from elastocal.campaigns.holdout import (
    FEWEST_HELD_OUT_POSES,
    held_out_mask,
    holdout_from,
    is_file,
    is_file_in,
    measured_poses,
    other_folder,
)
from elastocal.campaigns.measurement_checks import check_angles, check_measurements
from elastocal.campaigns.measurements import CSV, PARQUET, MeasurementFile, read_measurements, show_cell
from elastocal.counting import counted
from elastocal.errors import InputError, closest_first
from elastocal.io.documents import check_document, read_document
from elastocal.io.texts import kind_of
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import robot_from_document


def read_campaign(folder: str | Path, robots_folder: str | Path, effects: Collection[str] | None = None) -> Campaign:
    """Read a campaign and check it as a whole.

    `folder`: holds ``campaign.yaml`` and the measurements. `robots_folder`: holds the robots that a campaign may name.
    `effects`: names that ``declared`` may have; not checked without. Raises `InputError`: the first fault found: file, row and
    column or key, what stands there and what may.
    """
    folder = Path(folder)
    source = (folder / DOCUMENT).as_posix()
    document, robot_path = read_descriptions(folder, robots_folder)
    robot = read_robot(robot_path)
    targets = targets_from(document["targets"], robot.chain, source)
    holdout = holdout_from(document.get("holdout", DEFAULT_HOLDOUT), folder, source)
    for index, name in enumerate(document.get("declared", ())):
        if effects is not None and name not in set(effects):
            raise InputError(source, f"declared[{index}]", repr(name), closest_first(name, sorted(effects)))
    _tables(folder)
    table = read_measurements(folder, robot.joints, document["measured"])
    measurements = _measurements(table, robot, targets)
    check_measurements(measurements, table, robot, targets, source)
    _check_compliance(document, robot, robot_path, measurements, source)
    _check_noise(document, measurements, robot.joints, source)
    held_out_mask(holdout, measurements, robot.reported_offset, source)
    place = {"table": Path(table.path).name, "header_line": table.header_line}
    return assemble_campaign(document | {"holdout": holdout} | place, robot, measurements, source)


def read_descriptions(folder: str | Path, robots_folder: str | Path) -> tuple[dict[str, Any], Path]:
    """What a campaign says of itself, and where its robot is described.

    `folder`, `robots_folder`: as in `read_campaign`. Returns `document`: contents of ``campaign.yaml``, which follow their
    schema. Raises `InputError`: a document that its schema refuses, or a robot that is not there.
    """
    source = (Path(folder) / DOCUMENT).as_posix()
    _check_place(Path(source), folder)
    document = read_document(source)
    check_document(document, "campaign", source)
    return document, _robot_path(document["robot"], Path(folder), robots_folder, source)


def campaign_files(folder: str | Path, robots_folder: str | Path) -> list[str]:
    """Files that a campaign is read from, those of the campaign that holds its test included.

    `folder`, `robots_folder`: as in `read_campaign`. Raises `InputError`: as in `read_descriptions` and `holdout.other_folder`.
    """
    document, robot_path = read_descriptions(folder, robots_folder)
    files = [Path(folder) / DOCUMENT, *_tables(Path(folder)), robot_path]
    if other := document.get("holdout", {}).get("campaign"):
        there = other_folder(other, Path(folder), files[0].as_posix())
        # What tests the other one is no part of this one: two campaigns may test each other.
        files += [there / DOCUMENT, *_tables(there), read_descriptions(there, robots_folder)[1]]
    return [path.as_posix() for path in files]


def _tables(folder: Path) -> list[Path]:
    """Files of measurements in a folder; a link out of it, a pipe and the like are refused."""
    there = [path for kind in (CSV, PARQUET) if os.path.lexists(path := folder / kind)]
    for path in there:
        _check_place(path, folder)
    return there


def read_robot(path: str | Path) -> Robot:
    """Read a robot file; an `InputError` is as in `robot_from_document`, or names what the schema refuses."""
    source = Path(path).as_posix()
    document = read_document(source)
    check_document(document, "robot", source)
    return robot_from_document(document, source)


def held_out_campaign(
    campaign: Campaign, folder: str | Path, robots_folder: str | Path, effects: Collection[str] | None = None
) -> Campaign | None:
    """The other campaign that tests this one.

    `folder`: folder of `campaign`. `effects`: as in `read_campaign`. Returns with its own targets and frame; all of its
    measurements are for the test. None where this campaign holds out its own. Raises `InputError`: a fault of the other
    campaign, or another chain than this one's.
    """
    if "campaign" not in campaign.holdout:
        return None
    source, key = (Path(folder) / DOCUMENT).as_posix(), "holdout.campaign"
    other = read_campaign(other_folder(campaign.holdout["campaign"], Path(folder), source), robots_folder, effects)
    if other.robot.chain != campaign.robot.chain:
        allowed = f"a campaign of the same chain, {campaign.robot.name}"
        raise InputError(source, key, f"another chain, of {other.robot.name}", allowed)
    poses = len(measured_poses(other.measurements)[0])
    if poses < FEWEST_HELD_OUT_POSES:
        raise InputError(source, key, f"{counted(poses, 'pose')} there", f"{FEWEST_HELD_OUT_POSES} or more")
    return other


def folds_of(folder: str | Path, robots_folder: str | Path, number: int, of: int) -> dict[str, Any]:
    """Poses of one fold of a campaign, as in ``holdout`` of ``campaign.yaml``.

    Of K-fold cross-validation [1] by whole poses.

    `folder`, `robots_folder`: as in `read_campaign`. `number`: fold, from 1. `of`: how many folds; poses are dealt out in turn.

    [1] Geisser, S., The predictive sample reuse method with applications, Journal of the American Statistical Association 70,
        1975.
    """
    pairs = measured_poses(read_campaign(folder, robots_folder).measurements)[0]
    return {"poses": pairs[number - 1 :: of].tolist()}


def _check_compliance(
    document: Mapping[str, Any], robot: Robot, robot_path: Path, measurements: Measurements, source: str
) -> None:
    """Refuse loads on a robot whose compliances are neither known nor identified; without loads its joints count as rigid."""
    nominal = document.get("compliance", "nominal") == "nominal"
    if nominal and not robot.compliance_known and measurements.wrench.any():
        found = f"nominal, but no compliance_urad_per_Nm in {robot_path.name}, and loads"
        raise InputError(source, "compliance", found, "identify, or nominal with compliance_urad_per_Nm in the robot file")


def _check_noise(document: Mapping[str, Any], measurements: Measurements, joints: int, source: str) -> None:
    """Refuse noise of positions that is declared twice or not at all, and repeatabilities of other joints."""
    declared = document.get("noise")
    if declared is None:
        return
    if "position_m" in declared and measurements.u95_m is not None:
        raise InputError(source, "noise.position_m", "beside a column u95_m of the measurements", "one of them")
    if "position_m" not in declared and measurements.u95_m is None:
        raise InputError(source, "noise", "no position_m", "position_m, or a column u95_m of the measurements")
    each = declared.get("joint_rad", 0.0)
    if isinstance(each, list) and len(each) != joints:
        raise InputError(source, "noise.joint_rad", counted(len(each), "number"), f"one for all joints, or {joints}")


def _robot_path(name: str, folder: Path, robots_folder: str | Path, source: str) -> Path:
    known = sorted(file.stem for file in Path(robots_folder).glob("*.yaml"))
    path = Path(robots_folder) / f"{name}.yaml" if name in known else folder / name
    if not is_file_in(path, folder, robots_folder):
        listed = f"{Path(robots_folder).as_posix()}: {closest_first(name, known)}"
        allowed = f"a file in this folder, named relative to this folder, or a robot of {listed}"
        raise InputError(source, "robot", repr(name), allowed)
    return path


def _check_place(path: Path, folder: str | Path) -> None:
    if is_file(path) and not is_file_in(path, folder):
        raise InputError(path, "", "a link out of the campaign's folder", "the file itself")
    if os.path.lexists(path) and not is_file(path):
        raise InputError(path, "", f"{kind_of(os.lstat(path).st_mode)} that leads to no file", "the file itself")


def _measurements(table: MeasurementFile, robot: Robot, targets: Sequence[Target]) -> Measurements:
    reported = table.numbers(table.angles)
    check_angles(reported, table, robot)
    names = {target.name: index for index, target in enumerate(targets)}
    labels = table.texts("target")
    for index, label in enumerate(labels):
        if label not in names:
            allowed = f"a target of {DOCUMENT}: {closest_first(label, list(names))}"
            raise table.cell_fault(index, "target", show_cell(label), allowed)
    approach = None
    if table.has(table.approach):
        senses = table.numbers(table.approach)
        wrong = ~np.isin(senses, (-1.0, 0.0, 1.0))
        if wrong.any():
            index, joint = np.argwhere(wrong)[0]
            raise table.cell_fault(index, table.approach[joint], f"{senses[index, joint]:g}", "-1, 0 or 1")
        # Where a joint of the model follows two reported ones that came from opposite sides, its own sense is not known.
        approach = np.sign(senses @ robot.reported_matrix.T)
    return Measurements(
        session=table.integers("session") if table.has(["session"]) else np.zeros(len(table.rows), np.int32),
        pose=table.integers("pose"),
        load=table.integers("load"),
        repeat=table.integers("repeat"),
        target=np.array([names[label] for label in labels], np.int32),
        joint_angles=robot.model_angles(reported),
        wrench=table.numbers(table.wrench) if table.has(table.wrench) else np.zeros((len(table.rows), 6)),
        position=table.numbers("xyz"),
        rotation_vector=table.numbers(table.orientation) if table.orientation else None,
        approach=approach,
        **{name: table.numbers([name])[:, 0] if table.has([name]) else None for name in ("time_s", "temperature_c", "u95_m")},
        row=table.rows,
    )
