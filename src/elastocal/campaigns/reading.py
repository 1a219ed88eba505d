"""A campaign's folder, read and checked before anything is fitted to it.

A campaign is a folder of ``campaign.yaml`` and ``measurements.csv`` or
``measurements.parquet``, one row for each measurement of one target. All that is wrong
on its face is refused here, in one line; a unit that only a fit can show to be wrong is
left for the diagnosis to trace.
"""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.campaign import (
    DOCUMENT,
    Campaign,
    Measurements,
    Target,
    assemble_campaign,
    group_equal_rows,
    parse_targets,
)
from elastocal.campaigns.campaign_folder import CampaignFolder, read_robot_document
from elastocal.campaigns.holdout import (
    FEWEST_HELD_OUT_POSES,
    SAME_POSE_RAD,
    list_poses,
    select_held_out,
)
from elastocal.campaigns.measurements import (
    LARGEST_ROTATION_RAD,
    ROTATION,
    read_measurements,
)
from elastocal.campaigns.tables import Cells
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import robot_from_document


def read_campaign(
    folder: CampaignFolder, effects: Collection[str] | None = None
) -> Campaign:
    """Read a campaign's measurements and check the campaign as a whole.

    Parameters
    ----------
    folder : campaign on disk.
    effects : names that ``declared`` may have; not checked if None.

    Raises
    ------
    InputError
        The first fault: file, row and column or key, what was found and what is
        allowed.
    """
    document = folder.document
    robot = folder.robot
    source = folder.source
    targets = parse_targets(document["targets"], robot.chain, source)
    # Refuse a folder that cannot validate this campaign before reading measurements.
    _ = folder.held_out_path
    for index, name in enumerate(document.get("declared", ())):
        if effects is not None and name not in set(effects):
            raise InputError(
                source,
                f"declared[{index}]",
                repr(name),
                suggest_names(name, sorted(effects)),
            )
    table = read_measurements(folder.path, robot.joints, document["measured"])
    measurements = _measurements(table, robot, targets, document["measured"])
    _check_measurements(measurements, table, robot, targets, source)
    _check_stated(document, measurements, robot, folder.robot_file.name, source)
    select_held_out(folder.holdout, measurements, robot.reported_offset, source)
    place = {"table": Path(table.path).name, "header_line": table.header_line}
    return assemble_campaign(document | place, robot, measurements, source)


def read_robot(path: str | Path) -> Robot:
    """Read a robot file; an `InputError` is as in `robot_from_document`, or names what
    the schema refuses."""
    return robot_from_document(read_robot_document(path), Path(path).as_posix())


def read_held_out_campaign(
    folder: CampaignFolder, effects: Collection[str] | None = None
) -> Campaign | None:
    """Read the campaign that validates this one; None if this campaign holds out poses
    of its own.

    An `InputError` refuses a campaign of another chain or with too few poses.
    """
    if folder.held_out_folder is None:
        return None
    held_out = read_campaign(folder.held_out_folder, effects)
    key = "holdout.campaign"
    if held_out.robot.chain != folder.robot.chain:
        allowed = f"a campaign of the same chain, {folder.robot.name}"
        found = f"another chain, of {held_out.robot.name}"
        raise InputError(folder.source, key, found, allowed)
    poses = len(list_poses(held_out.measurements)[0])
    if poses < FEWEST_HELD_OUT_POSES:
        found = f"{format_count(poses, 'pose')} there"
        allowed = f"{FEWEST_HELD_OUT_POSES} or more"
        raise InputError(folder.source, key, found, allowed)
    return held_out


def _check_stated(
    document: Mapping[str, Any],
    measurements: Measurements,
    robot: Robot,
    robot_file: str,
    source: str,
) -> None:
    """Refuse loads on unknown compliances that are not identified, noise declared twice
    or not at all, or of other joints."""
    nominal = document.get("compliance", "nominal") == "nominal"
    if nominal and not robot.compliance_known and measurements.wrench.any():
        found = f"nominal, but no compliance_urad_per_Nm in {robot_file}, and loads"
        raise InputError(
            source,
            "compliance",
            found,
            "identify, or nominal with compliance_urad_per_Nm in the robot file",
        )
    if (declared := document.get("noise")) is None:
        return
    if "position_m" in declared and measurements.u95_m is not None:
        raise InputError(
            source,
            "noise.position_m",
            "beside a column u95_m of the measurements",
            "one of them",
        )
    if "position_m" not in declared and measurements.u95_m is None:
        raise InputError(
            source,
            "noise",
            "no position_m",
            "position_m, or a column u95_m of the measurements",
        )
    each = declared.get("joint_rad", 0.0)
    if isinstance(each, list) and len(each) != robot.joints:
        raise InputError(
            source,
            "noise.joint_rad",
            format_count(len(each), "number"),
            f"one for all joints, or {robot.joints}",
        )


def _measurements(
    table: Cells, robot: Robot, targets: Sequence[Target], measured: str
) -> Measurements:
    reported = table.matrix(f"q{j}" for j in range(1, robot.joints + 1))
    degrees = find_degrees(reported, robot)
    if degrees.any(axis=1).mean() > _SINGLE_ROWS:
        index, joint = np.argwhere(degrees)[0]
        limits = "from {:.2f} to {:.2f} rad".format(*robot.joint_limits[joint])
        allowed = f"rad, not degrees, of a joint that goes {limits} (counted otherwise: reported_joints of the robot file)"
        raise table.fault(index, f"q{joint + 1}", allowed)
    names = {target.name: index for index, target in enumerate(targets)}
    labels = table.texts("target")
    unknown = next(
        (index for index, label in enumerate(labels) if label not in names), None
    )
    if unknown is not None:
        raise table.fault(
            unknown,
            "target",
            f"a target of {DOCUMENT}: {suggest_names(labels[unknown], list(names))}",
        )
    approach = None
    if "approach1" in table.columns:
        approach = table.matrix(f"approach{j}" for j in range(1, robot.joints + 1))
        table.refuse(
            ~np.isin(approach, (-1.0, 0.0, 1.0)),
            [f"approach{j}" for j in range(1, robot.joints + 1)],
            "-1, 0 or 1",
        )
        # Where a joint of the model follows two reported ones that came from opposite
        # sides, its own sense is not known.
        approach = np.sign(approach @ robot.reported_matrix.T)
    return Measurements(
        session=table.integers("session")
        if "session" in table.columns
        else np.zeros(len(table.rows), np.int32),
        pose=table.integers("pose"),
        load=table.integers("load"),
        repeat=table.integers("repeat"),
        target=np.array([names[label] for label in labels], np.int32),
        joint_angles=robot.model_angles(reported),
        wrench=table.matrix(WRENCH_NAMES)
        if "fx" in table.columns
        else np.zeros((len(table.rows), 6)),
        position=table.matrix("xyz"),
        rotation_vector=table.matrix(ROTATION) if measured == "pose" else None,
        approach=approach,
        **{
            name: table.numbers(name) if name in table.columns else None
            for name in ("time_s", "temperature_c", "u95_m")
        },
        row=table.rows,
    )


# A joint this far beyond its limits is no joint at its limit.
_BEYOND_LIMITS_RAD = 0.5
# A unit is wrong in a whole file. What is off in fewer rows than this is a gross error
# of theirs, which the diagnosis names.
_SINGLE_ROWS = 0.2
# Positions spread over more reaches than this are not in metres. Millimetres spread so
# unless all lie within centimetres.
_FARTHEST_REACHES = 10.0
# A target sits at most about this far from its measuring point.
_LONGEST_TOOL_M = 1.0


def find_degrees(reported: np.ndarray, robot: Robot) -> np.ndarray:
    """Angles that look like degrees: more turns than a joint has, or far beyond limits
    that a 57th of the angle keeps.

    `reported` (N, n): joint angles as the controller reports them. Returns (N, n) of
    bool.
    """
    low, high = robot.joint_limits.T

    def off(reported: np.ndarray) -> np.ndarray:
        angles = robot.model_angles(reported)
        return np.asarray(np.maximum(low - angles, angles - high))

    found = np.abs(reported) > max(
        LARGEST_ROTATION_RAD, np.abs(robot.joint_limits).max()
    )
    some = (off(reported) > _BEYOND_LIMITS_RAD).any(axis=1)
    # An angle that its opposite would bring inside the limits has rather a wrong sign,
    # which is for the diagnosis to trace.
    beyond = np.minimum(off(reported[some]), off(-reported[some])) > _BEYOND_LIMITS_RAD
    found[some] |= beyond & (off(np.radians(reported[some])) <= 0)
    return found


def _check_measurements(
    measurements: Measurements,
    table: Cells,
    robot: Robot,
    targets: Sequence[Target],
    source: str,
) -> None:
    """Refuse measurements that cannot be of one campaign, `source`, in the units of the
    format, by their places there."""
    names = ("session", "pose", "load", "repeat", "target")
    key = np.column_stack([getattr(measurements, name) for name in names])
    first, group = group_equal_rows(key)
    again = first[group] != np.arange(len(measurements))
    if again.any():
        index = int(np.argmax(again))
        words = [
            f"{name} {value}"
            for name, value in zip(names, key[index], strict=True)
            if name in table.columns
        ]
        found = f"{', '.join(words[:-1])}, target {targets[key[index, -1]].name} again"
        raise table.fault(
            index, "", f"each once (first in {table.place(first[group[index]])})", found
        )
    unloaded = measurements.load == 0
    if "fx" not in table.columns:
        table.refuse(
            ~unloaded,
            ["load"],
            f"0 where there are no columns {', '.join(WRENCH_NAMES)}",
        )
    table.refuse(
        unloaded[:, None] & (measurements.wrench != 0),
        WRENCH_NAMES,
        "0 where load is 0",
    )
    pose_of = list_poses(measurements)[1]
    angles = [f"q{j}" for j in range(1, robot.joints + 1)]
    reported = table.matrix(angles)
    first = np.unique(pose_of, return_index=True)[1]
    apart = np.abs(reported - reported[first[pose_of]]) > SAME_POSE_RAD
    if apart.any():
        earlier = table.place(first[pose_of[np.argwhere(apart)[0, 0]]])
        table.refuse(
            apart,
            angles,
            f"within {SAME_POSE_RAD} rad of {earlier}, which is of the same pose",
        )
    tool = max(
        (
            np.linalg.norm(target.offset_m)
            for target in targets
            if target.offset_m is not None
        ),
        default=_LONGEST_TOOL_M,
    )
    reach = tool + sum(
        abs(transform.constant)
        for transform in robot.chain.transforms
        if transform.kind == "T"
    )
    for session in np.unique(measurements.session):
        position = np.where(
            (measurements.session == session)[:, None], measurements.position, np.nan
        )
        away = np.abs(position - np.nanmedian(position, axis=0))
        if (
            np.nanquantile(away.max(axis=1), 1.0 - _SINGLE_ROWS)
            > _FARTHEST_REACHES * reach
        ):
            allowed = f"metres, not millimetres; the robot reaches {reach:.3g} m"
            table.refuse(away == np.nanmax(away), "xyz", allowed)
    if measurements.rotation_vector is not None:
        angle = np.linalg.norm(measurements.rotation_vector, axis=1)
        allowed = (
            f"a rotation vector in rad, not degrees, {LARGEST_ROTATION_RAD:.3g} at most"
        )
        table.refuse(
            angle == max(angle.max(), LARGEST_ROTATION_RAD),
            ["rx, ry, rz"],
            allowed,
            f"a turn of {angle.max():.4g}",
        )
    for index, target in enumerate(targets):
        if not (measurements.target == index).any():
            allowed = f"targets that {Path(table.path).name} has measurements of"
            raise InputError(
                source, f"targets.{target.name}", "no measurement of it", allowed
            )
