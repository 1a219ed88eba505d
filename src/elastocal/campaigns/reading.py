"""Read a campaign's measurements and check the campaign before anything is fitted to it.

Each fault that the files alone show is refused with a message of one line. A unit that
only a fit can prove wrong is left to the diagnosis.
"""

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
    complete_noise,
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
    read_measurements,
)
from elastocal.campaigns.numbers import list_required_columns, read_numbers
from elastocal.campaigns.tables import Cells
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.measuring.channels import MeasuringPlan, parse_measuring
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import parse_robot

# A joint angle this far beyond the limits is not the angle of a joint at its limit.
_BEYOND_LIMITS_RAD = 0.5
# A wrong unit affects a whole file. If at most this share of the rows is implausible,
# they are gross errors, which the diagnosis names.
_GROSS_ERROR_SHARE = 0.2
# Positions that spread over more than this multiple of the reach are not in metres.
# Positions in millimetres do, unless all lie within a few centimetres.
_LARGEST_SPREAD_REACHES = 10.0
# A clock is set back by an hour or a day. This much time, at most, passes between two
# measurements of a session.
_SET_BACK_S = (3600.0, 86400.0)
_BETWEEN_S = 900.0
# Distance of a target from its measuring point, if no offset is stated. Few targets sit
# farther away.
_UNKNOWN_OFFSET_M = 1.0


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
    # Refuse what the documents alone show before reading measurements.
    parse_targets(document["targets"], robot.chain, folder.source)
    _ = folder.held_out_path
    if effects is not None:
        check_declared(document, effects, folder.source)
    plan = parse_measuring(document, folder.source)
    table = read_measurements(folder.path, robot.commands, list_required_columns(plan))
    file = {"table": Path(table.path).name, "header_line": table.header_line}
    return build_campaign(document | file, robot, table, folder.source)


def build_campaign(
    document: Mapping[str, Any], robot: Robot, table: Cells, source: str
) -> Campaign:
    """Build a campaign from a table of measurements, and check it as a whole.

    Parameters
    ----------
    document : contents of ``campaign.yaml``, valid by its schema; may also have
        ``table`` and ``header_line`` of `Campaign`.
    robot : nominal robot.
    table : measurements, with all columns that they need.
    source : file of the document, for messages.

    Raises
    ------
    InputError
        As `read_campaign`.
    """
    plan = parse_measuring(document, source)
    noise = complete_noise(document.get("noise"), plan)
    targets = parse_targets(document["targets"], robot.chain, source)
    measurements = _build_measurements(table, robot, targets)
    _check_states(measurements, table, robot)
    measurements = read_numbers(measurements, table, plan, noise)
    _refuse_duplicates(measurements, table, targets)
    if not plan.channels:
        _check_poses(measurements, table, robot, targets)
    _check_features_measured(measurements, plan, source)
    _check_targets_measured(measurements, table, targets, source)
    _check_compliance(document, robot, measurements, source)
    if "base_std_m" in document and document["frame"] != "base":
        allowed = "frame: base; an unknown placement of the base has no prior"
        raise InputError(source, "base_std_m", f"frame: {document['frame']}", allowed)
    _check_noise(noise, measurements, robot, source)
    holdout = document.get("holdout", DEFAULT_HOLDOUT)
    select_held_out(holdout, measurements, robot.reported_offset, source)
    return assemble_campaign(document, robot, measurements, source)


def read_robot(path: str | Path) -> Robot:
    """Read a robot file; an `InputError` names what its schema or
    `parse_robot` refuses."""
    return parse_robot(read_robot_document(path), Path(path).as_posix())


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
        finding = f"another chain, of {held_out.robot.name}"
        raise InputError(folder.source, key, finding, allowed)
    pose_count = len(list_poses(held_out.measurements)[0])
    if pose_count < FEWEST_HELD_OUT_POSES:
        finding = f"{format_count(pose_count, 'pose')} there"
        allowed = f"{FEWEST_HELD_OUT_POSES} or more"
        raise InputError(folder.source, key, finding, allowed)
    return held_out


def find_degrees(reported: np.ndarray, robot: Robot) -> np.ndarray:
    """Find joint angles that are probably in degrees.

    Such an angle has more turns than a joint makes, or is far beyond the limits of its
    joint and within them if it is converted to radians.

    Parameters
    ----------
    reported : (N, n) joint angles as the controller reports them.
    robot : robot with the joint limits.

    Returns
    -------
    (N, n) bool array.
    """
    leading = robot.leading_joints
    low, high = robot.joint_limits[leading].T

    def excess(reported_angles: np.ndarray) -> np.ndarray:
        """Return by how much angles exceed the limits; negative within them."""
        angles = robot.model_angles(reported_angles)[:, leading]
        return np.asarray(np.maximum(low - angles, angles - high))

    largest = max(LARGEST_ROTATION_RAD, np.abs(robot.joint_limits).max())
    in_degrees = np.abs(reported) > largest
    rows = (excess(reported) > _BEYOND_LIMITS_RAD).any(axis=1)
    suspects = reported[rows]
    # If the opposite angle is within the limits, the sign is probably wrong, which the
    # diagnosis finds.
    smallest_excess = np.minimum(excess(suspects), excess(-suspects))
    within_as_degrees = excess(np.radians(suspects)) <= 0
    in_degrees[rows] |= (smallest_excess > _BEYOND_LIMITS_RAD) & within_as_degrees
    return in_degrees


def check_declared(
    document: Mapping[str, Any], effects: Collection[str], source: str
) -> None:
    """Refuse a declared effect that the catalogue does not have."""
    for index, name in enumerate(document.get("declared", ())):
        if name not in effects:
            allowed = suggest_names(name, sorted(effects))
            raise InputError(source, f"declared[{index}]", repr(name), allowed)


def _check_compliance(
    document: Mapping[str, Any], robot: Robot, measurements: Measurements, source: str
) -> None:
    """Refuse loads on joints whose compliances are neither stated nor identified."""
    nominal = document.get("compliance", "nominal") == "nominal"
    if nominal and not robot.compliance_known and measurements.wrench.any():
        file = Path(document["robot"]).name
        finding = f"nominal, but no compliance_urad_per_Nm in {file}, and loads"
        allowed = "identify, or nominal with compliance_urad_per_Nm in the robot file"
        raise InputError(source, "compliance", finding, allowed)


def _check_noise(
    noise: Mapping[str, Any] | None,
    measurements: Measurements,
    robot: Robot,
    source: str,
) -> None:
    """Refuse a declared noise of positions that contradicts or lacks a column of
    uncertainties, and a noise of another number of joints."""
    if noise is None:
        return
    if "position_m" in noise and measurements.u95_m is not None:
        finding = "beside a column u95_m of the measurements"
        raise InputError(source, "noise.position_m", finding, "one of them")
    if "position_m" not in noise and measurements.u95_m is None:
        allowed = "position_m, or a column u95_m of the measurements"
        raise InputError(source, "noise", "no position_m", allowed)
    joint_rad = noise.get("joint_rad", 0.0)
    if isinstance(joint_rad, list) and len(joint_rad) != robot.joints:
        finding = format_count(len(joint_rad), "number")
        allowed = f"one for all joints, or {robot.joints}"
        raise InputError(source, "noise.joint_rad", finding, allowed)


def _build_measurements(
    table: Cells, robot: Robot, targets: Sequence[Target]
) -> Measurements:
    """Return the measurements of a table, still without the numbers that were measured;
    angles in degrees and unknown targets are refused."""
    reported = table.matrix(list_joint_columns(robot.commands))
    _refuse_degrees(reported, table, robot)
    count = len(table.rows)

    def optional(name: str) -> np.ndarray | None:
        return table.numbers(name) if name in table.columns else None

    has_session = "session" in table.columns
    has_wrench = "fx" in table.columns
    return Measurements(
        session=table.integers("session") if has_session else np.zeros(count, np.int32),
        pose=table.integers("pose"),
        load=table.integers("load"),
        repeat=table.integers("repeat"),
        target=_target_indices(table, targets),
        joint_angles=robot.model_angles(reported),
        wrench=table.matrix(WRENCH_NAMES) if has_wrench else np.zeros((count, 6)),
        position=np.zeros((count, 3)),
        rotation_vector=None,
        approach=_approach_directions(table, robot),
        time_s=optional("time_s"),
        temperature_c=optional("temperature_c"),
        u95_m=optional("u95_m"),
        row=table.rows,
    )


def _refuse_degrees(reported: np.ndarray, table: Cells, robot: Robot) -> None:
    """Refuse a table whose reported angles (N, n) are in degrees in many rows."""
    in_degrees = find_degrees(reported, robot)
    if in_degrees.any(axis=1).mean() <= _GROSS_ERROR_SHARE:
        return
    row, joint = np.argwhere(in_degrees)[0]
    limits = "from {:.2f} to {:.2f} rad".format(
        *robot.joint_limits[robot.leading_joints[joint]]
    )
    allowed = (
        f"rad, not degrees, of a joint that goes {limits} "
        "(counted otherwise: reported_joints of the robot file)"
    )
    raise table.fault(row, f"q{joint + 1}", allowed)


def _target_indices(table: Cells, targets: Sequence[Target]) -> np.ndarray:
    """Return the index of the target of each row, (N,)."""
    indices = {target.name: index for index, target in enumerate(targets)}
    labels = table.texts("target")
    for row, label in enumerate(labels):
        if label not in indices:
            names = suggest_names(label, list(indices))
            raise table.fault(row, "target", f"a target of {DOCUMENT}: {names}")
    return np.array([indices[label] for label in labels], np.int32)


def _approach_directions(table: Cells, robot: Robot) -> np.ndarray | None:
    """Return the direction from which each of the model's joints was approached, (N, n)
    of -1, 0 or 1; None if the table does not state it."""
    if "approach1" not in table.columns:
        return None
    names = list_joint_columns(robot.commands, "approach")
    approach = table.matrix(names)
    table.refuse(~np.isin(approach, (-1.0, 0.0, 1.0)), names, "-1, 0 or 1")
    # If a joint of the model is the sum of two reported joints that came from opposite
    # sides, its own direction is unknown.
    return np.sign(approach @ robot.reported_matrix.T)


def _check_states(measurements: Measurements, table: Cells, robot: Robot) -> None:
    """Refuse states of the robot that cannot belong to one campaign."""
    _refuse_undeclared_loads(measurements, table)
    _refuse_poses_of_different_angles(measurements, table, robot)
    _refuse_clocks_set_back(measurements, table)


def _check_poses(
    measurements: Measurements, table: Cells, robot: Robot, targets: Sequence[Target]
) -> None:
    """Refuse positions and orientations in other units than those of the format."""
    _refuse_millimetres(measurements, table, robot, targets)
    if measurements.rotation_vector is not None:
        _refuse_large_rotations(measurements.rotation_vector, table)


def _refuse_duplicates(
    measurements: Measurements, table: Cells, targets: Sequence[Target]
) -> None:
    """Refuse a second measurement of the same session, pose, load, repeat and
    target."""
    names = ["session", "pose", "load", "repeat", "target"]
    columns = [getattr(measurements, name) for name in names]
    if measurements.channel is not None:
        # The target is the last key that a message names.
        columns.insert(0, measurements.channel)
        names.insert(0, "channel")
    keys = np.column_stack(columns)
    first, group = group_equal_rows(keys)
    duplicate = first[group] != np.arange(len(measurements))
    if not duplicate.any():
        return
    index = int(np.argmax(duplicate))
    numbers = [
        f"{name} {value}"
        for name, value in zip(names[:-1], keys[index, :-1], strict=True)
        if name in table.columns
    ]
    target = targets[keys[index, -1]].name
    finding = f"{', '.join(numbers)}, target {target} again"
    # A row with several measurements has one place in the table.
    row, earlier = np.searchsorted(
        table.rows, measurements.row[[index, first[group[index]]]]
    ).tolist()
    allowed = f"each once (first in {table.locate(earlier)})"
    raise table.fault(row, "", allowed, finding)


def _refuse_undeclared_loads(measurements: Measurements, table: Cells) -> None:
    """Refuse a loaded measurement without a wrench, and a wrench without a load."""
    unloaded = measurements.load == 0
    if "fx" not in table.columns:
        columns = ", ".join(WRENCH_NAMES)
        table.refuse(~unloaded, ["load"], f"0 where there are no columns {columns}")
    wrong = unloaded[:, None] & (measurements.wrench != 0)
    table.refuse(wrong, WRENCH_NAMES, "0 where load is 0")


def _refuse_poses_of_different_angles(
    measurements: Measurements, table: Cells, robot: Robot
) -> None:
    """Refuse measurements of one pose whose joint angles differ by more than a servo
    error."""
    pose = list_poses(measurements)[1]
    names = list_joint_columns(robot.commands)
    reported = table.matrix(names)
    first = np.unique(pose, return_index=True)[1]
    apart = np.abs(reported - reported[first[pose]]) > SAME_POSE_RAD
    if apart.any():
        row = np.argwhere(apart)[0, 0]
        earlier = table.locate(first[pose[row]])
        allowed = f"within {SAME_POSE_RAD} rad of {earlier}, which is of the same pose"
        table.refuse(apart, names, allowed)


def _refuse_clocks_set_back(measurements: Measurements, table: Cells) -> None:
    """Refuse times of a session that fall once by about an hour, as at the end of summer
    time, or a day, as the time of day does at midnight, and rise otherwise.

    A file that lists one target after the other at the same poses begins again without
    a wrong clock.
    """
    if measurements.time_s is None:
        return
    pose = list_poses(measurements)[1]
    for session in np.unique(measurements.session):
        rows = np.flatnonzero(measurements.session == session)
        fall = _find_set_back(np.diff(measurements.time_s[rows]))
        if fall is None:
            continue
        before, after = rows[: fall + 1], rows[fall + 1 :]
        if len(np.intersect1d(pose[before], pose[after])) > 1:
            continue
        earlier_s = measurements.time_s[before[-1]]
        raise table.fault(
            int(after[0]),
            "time_s",
            "a clock that is not set back: add the hour or the day to the later times",
            f"{measurements.time_s[after[0]]:.15g} after {earlier_s:.15g}",
        )


def _find_set_back(steps: np.ndarray) -> int | None:
    """Find the only one of the steps of time (N,), s, that falls, if it falls as a clock
    that is set back."""
    falls = np.flatnonzero(steps < 0.0)
    if len(falls) != 1:
        return None
    largest_rise = np.delete(steps, falls[0]).max(initial=0.0)
    for set_back_s in _SET_BACK_S:
        between_s = steps[falls[0]] + set_back_s
        if 0.0 <= between_s <= _BETWEEN_S and largest_rise < set_back_s - _BETWEEN_S:
            return int(falls[0])
    return None


def _refuse_millimetres(
    measurements: Measurements, table: Cells, robot: Robot, targets: Sequence[Target]
) -> None:
    """Refuse positions of a session that spread far beyond the robot's reach."""
    reach = _longest_offset_m(targets) + sum(
        abs(transform.constant)
        for transform in robot.chain.transforms
        if transform.kind == "T"
    )
    for session in np.unique(measurements.session):
        in_session = (measurements.session == session)[:, None]
        position = np.where(in_session, measurements.position, np.nan)
        distance = np.abs(position - np.nanmedian(position, axis=0))
        spread = np.nanquantile(distance.max(axis=1), 1.0 - _GROSS_ERROR_SHARE)
        if spread > _LARGEST_SPREAD_REACHES * reach:
            allowed = f"metres, not millimetres; the robot reaches {reach:.3g} m"
            table.refuse(distance == np.nanmax(distance), "xyz", allowed)


def _longest_offset_m(targets: Sequence[Target]) -> float:
    """Return the largest known distance of a target from its measuring point."""
    offsets = [target.offset_m for target in targets if target.offset_m is not None]
    lengths = [float(np.linalg.norm(offset)) for offset in offsets]
    return max(lengths, default=_UNKNOWN_OFFSET_M)


def _refuse_large_rotations(rotation_vector: np.ndarray, table: Cells) -> None:
    """Refuse the largest rotation vector of (N, 3) if no rotation is that large."""
    angle = np.linalg.norm(rotation_vector, axis=1)
    table.refuse(
        angle == max(angle.max(), LARGEST_ROTATION_RAD),
        ["rx, ry, rz"],
        f"a rotation vector in rad, not degrees, {LARGEST_ROTATION_RAD:.3g} at most",
        f"a turn of {angle.max():.4g}",
    )


def _check_targets_measured(
    measurements: Measurements, table: Cells, targets: Sequence[Target], source: str
) -> None:
    """Refuse a target that was not measured."""
    for index, target in enumerate(targets):
        if not (measurements.target == index).any():
            allowed = f"targets that {Path(table.path).name} has measurements of"
            key = f"targets.{target.name}"
            raise InputError(source, key, "no measurement of it", allowed)


def _check_features_measured(
    measurements: Measurements, plan: MeasuringPlan, source: str
) -> None:
    """Refuse a feature that no row refers to."""
    if measurements.channel is None:
        return
    for index, channel in enumerate(plan.channels):
        if channel.feature is not None and not (measurements.channel == index).any():
            name = plan.features[channel.feature].name
            allowed = "features that the measurements have rows of"
            raise InputError(source, f"features.{name}", "no row of it", allowed)
