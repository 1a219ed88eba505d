"""A measured campaign: what a tracker read of a robot, checked before anything is fitted to it.

A campaign is a folder of ``campaign.yaml`` and ``measurements.csv`` or ``measurements.parquet``, one row for each reading of
one target. All that can be told wrong without fitting anything is refused here, in one line; a unit that only a fit can tell
wrong is left for the diagnosis to trace.
"""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import yaml

from elastocal.campaigns.groups import groups_of
from elastocal.campaigns.joint_space import blocks
from elastocal.campaigns.measurements import (
    CSV,
    PARQUET,
    check_column_names,
    closest_first,
    read_measurements,
    shown,
    write_measurements,
)
from elastocal.errors import InputError
from elastocal.io.atomic_writes import appearing_whole
from elastocal.io.documents import check_document, read_document
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import robot_from_document

DOCUMENT = "campaign.yaml"
DEFAULT_HOLDOUT = {"fraction": 0.3, "seed": 1}
HOLDOUTS = ("fraction", "blocks", "session", "poses", "campaign")
# Below these a fit or a test says nothing.
FEWEST_TRAINING_POSES, FEWEST_HELD_OUT_POSES = 5, 2

# Readings of one pose share their joint angles up to what a controller's servo error can differ.
_SAME_POSE_RAD = 0.02
# No joint of a serial arm reports more than one and a half turns unless its limits say so.
_FARTHEST_RAD = 3.0 * np.pi
# A joint this far beyond its limits is no joint at its limit.
_BEYOND_LIMITS_RAD = 0.5
# Positions spread over more reaches than this are not in metres. Millimetres spread so unless all lie within centimetres.
_FARTHEST_REACHES = 10.0
# A target sits at most about this far from its measuring point.
_LONGEST_TOOL_M = 1.0


@dataclass(frozen=True)
class Target:
    """What is tracked.

    Attributes
    ----------
    name : str
    point : str
        Measuring point of the chain on which it sits.
    offset_m : tuple of float or None
        In the frame of the point; None where unknown and fitted.
    """

    name: str
    point: str
    offset_m: tuple | None


@dataclass(frozen=True)
class Readings:
    """One entry for each reading of one target; arrays of N.

    Attributes
    ----------
    session, pose, load, repeat : ndarray of int32 (N,)
        Session 0 where the file has no such column; load 0 is unloaded.
    target : ndarray of int32 (N,)
        Index into the campaign's targets.
    joint_angles : ndarray (N, n)
        The model's, rad, not the controller's: `Robot.model_angles` of what it reports.
    wrench : ndarray (N, 6)
        External wrench at the origin of the last measuring point, base axes; N, N m.
    position : ndarray (N, 3)
        m, in the campaign's frame.
    rotation_vector : ndarray (N, 3) or None
        rad; None where positions are measured.
    approach : ndarray (N, n) or None
        Sense in which each of the model's joints was approached, -1, 0 (not known) or +1.
    time_s, temperature_c : ndarray (N,) or None
    row : ndarray of int32 (N,)
        Row in the file, 1 for the first of data; for messages.
    """

    session: np.ndarray
    pose: np.ndarray
    load: np.ndarray
    repeat: np.ndarray
    target: np.ndarray
    joint_angles: np.ndarray
    wrench: np.ndarray
    position: np.ndarray
    rotation_vector: np.ndarray | None
    approach: np.ndarray | None
    time_s: np.ndarray | None
    temperature_c: np.ndarray | None
    row: np.ndarray

    def __len__(self):
        return len(self.pose)

    def select(self, mask_or_index):
        """The readings of a mask or of an index array, in its order.

        Parameters
        ----------
        mask_or_index : ndarray of bool (N,) or of int (M,)

        Returns
        -------
        Readings
        """
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        return Readings(**{name: None if array is None else array[mask_or_index] for name, array in arrays.items()})


@dataclass(frozen=True)
class Campaign:
    """A campaign that holds together.

    Attributes
    ----------
    name : str
    robot : Robot
    measured : {"position", "pose"}
    frame : {"tracker", "base"}
        tracker: the placement of the base in it is unknown, and another one in each session.
    targets : tuple of Target
    compliance : {"nominal", "identify"}
    declared : tuple of str
        Effects of the catalogue that the model already has.
    noise : dict or None
        ``position_m`` and maybe ``orientation_rad``, where the campaign declares them.
    holdout : dict
        ``fraction`` and ``seed``, ``blocks`` and ``seed``, ``session``, ``poses`` or ``campaign``.
    readings : Readings
    """

    name: str
    robot: Robot
    measured: str
    frame: str
    targets: tuple
    compliance: str
    declared: tuple
    noise: dict | None
    holdout: dict
    readings: Readings


def read_campaign(folder, robots_folder, effects=None):
    """Read a campaign and check it as a whole.

    Parameters
    ----------
    folder : str or Path
        Holds ``campaign.yaml`` and the measurements.
    robots_folder : str or Path
        Holds the robots that a campaign may name.
    effects : iterable of str, optional
        Names that ``declared`` may have; not checked without.

    Returns
    -------
    Campaign

    Raises
    ------
    InputError
        The first fault found: file, row and column or key, what stands there and what may.
    """
    folder = Path(folder)
    source = (folder / DOCUMENT).as_posix()
    document, robot_path = read_descriptions(folder, robots_folder)
    robot = read_robot(robot_path)
    targets = _targets(document["targets"], robot.chain, source)
    holdout = _holdout(document.get("holdout", DEFAULT_HOLDOUT), folder, source)
    for index, name in enumerate(document.get("declared", ())):
        if effects is not None and name not in set(effects):
            raise InputError(source, f"declared[{index}]", repr(name), closest_first(name, sorted(effects)))
    table = read_measurements(folder, robot.joints, document["measured"])
    readings = _readings(table, robot, targets)
    _check_readings(readings, table, robot, targets, source)
    _held_out(holdout, readings, source)
    return described_campaign(document | {"holdout": holdout}, robot, readings, source)


def read_descriptions(folder, robots_folder):
    """What a campaign says of itself, and where its robot is described.

    Parameters
    ----------
    folder, robots_folder : str or Path
        As in `read_campaign`.

    Returns
    -------
    document : dict
        Contents of ``campaign.yaml``, which follow their schema.
    robot_path : Path

    Raises
    ------
    InputError
        A document that its schema refuses, or a robot that is not there.
    """
    source = (Path(folder) / DOCUMENT).as_posix()
    document = read_document(source)
    check_document(document, "campaign", source)
    return document, _robot_path(document["robot"], Path(folder), robots_folder, source)


def campaign_files(folder, robots_folder):
    """Files that a campaign is read from, those of the campaign that holds its test included.

    Parameters
    ----------
    folder, robots_folder : str or Path
        As in `read_campaign`.

    Returns
    -------
    list of str

    Raises
    ------
    InputError
        As in `read_descriptions`.
    """
    document, robot_path = read_descriptions(folder, robots_folder)
    files = [Path(folder) / DOCUMENT, *(path for kind in (CSV, PARQUET) if (path := Path(folder) / kind).is_file()), robot_path]
    other = document.get("holdout", {}).get("campaign")
    beyond = campaign_files(Path(folder) / other, robots_folder) if other else []
    return [path.as_posix() for path in files] + beyond


def described_campaign(document, robot, readings, source):
    """A campaign from its parts, which have been checked before.

    Parameters
    ----------
    document : dict
        Contents of ``campaign.yaml``.
    robot : Robot
    readings : Readings
    source : str
        Named in errors.

    Returns
    -------
    Campaign
    """
    return Campaign(
        name=document["campaign"],
        robot=robot,
        measured=document["measured"],
        frame=document["frame"],
        targets=_targets(document["targets"], robot.chain, source),
        compliance=document.get("compliance", "nominal"),
        declared=tuple(document.get("declared", ())),
        noise=document.get("noise"),
        holdout=document.get("holdout", DEFAULT_HOLDOUT),
        readings=readings,
    )


def read_robot(path):
    """Read a robot file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Robot

    Raises
    ------
    InputError
        As in `robot_from_document`, and a document that its schema refuses.
    """
    source = Path(path).as_posix()
    document = read_document(source)
    check_document(document, "robot", source)
    return robot_from_document(document, source)


def split(campaign):
    """Readings to fit and readings to test, parted by whole poses.

    Parameters
    ----------
    campaign : Campaign

    Returns
    -------
    training, held_out : Readings
        In the order of the file, on which the choice of poses does not depend. Where another campaign is the test, all readings
        are training and `held_out` is empty: see `held_out_campaign`.

    Raises
    ------
    InputError
        Too few poses, or poses that are not there.
    """
    held_out = _held_out(campaign.holdout, campaign.readings, campaign.name)
    return campaign.readings.select(~held_out), campaign.readings.select(held_out)


def folds_of(folder, robots_folder, number, of):
    """Poses of one fold of a campaign, as in ``holdout`` of ``campaign.yaml``.

    Parameters
    ----------
    folder, robots_folder : str or Path
        As in `read_campaign`.
    number : int
        Fold, from 1.
    of : int
        How many folds; poses are dealt out in turn.

    Returns
    -------
    dict
    """
    pairs = _poses(read_campaign(folder, robots_folder).readings)[0]
    return {"poses": pairs[number - 1 :: of].tolist()}


def held_out_campaign(campaign, folder, robots_folder, effects=None):
    """The other campaign that tests this one.

    Parameters
    ----------
    campaign : Campaign
    folder : str or Path
        Folder of `campaign`.
    robots_folder : str or Path
    effects : iterable of str, optional
        As in `read_campaign`.

    Returns
    -------
    Campaign or None
        With its own targets and frame; all of its readings are for the test. None where this campaign holds out its own.

    Raises
    ------
    InputError
        A fault of the other campaign, or another chain than this one's.
    """
    if "campaign" not in campaign.holdout:
        return None
    other_folder = Path(folder) / campaign.holdout["campaign"]
    other = read_campaign(other_folder, robots_folder, effects)
    source, key = (Path(folder) / DOCUMENT).as_posix(), "holdout.campaign"
    if other.robot.chain != campaign.robot.chain:
        raise InputError(
            source, key, f"another chain, of {other.robot.name}", f"a campaign of the same chain, {campaign.robot.name}"
        )
    poses = len(_poses(other.readings)[0])
    if poses < FEWEST_HELD_OUT_POSES:
        raise InputError(source, key, f"{poses} poses there", f"{FEWEST_HELD_OUT_POSES} or more")
    return other


def write_campaign(folder, document, table, joints, kind="parquet"):
    """Write a campaign's folder; each file appears whole or not at all, ``campaign.yaml`` last.

    Parameters
    ----------
    folder : str or Path
        Made where it is not there.
    document : dict
        Contents of ``campaign.yaml``.
    table : dict of str to sequence
        Columns of one length, named as in `measurement_columns`.
    joints : int
    kind : {"parquet", "csv"}

    Raises
    ------
    InputError
        A document that the schema refuses, or a column that the format does not have.
    """
    folder = Path(folder)
    check_document(document, "campaign", (folder / DOCUMENT).as_posix())
    path = folder / (PARQUET if kind == "parquet" else CSV)
    check_column_names(table, joints, path.as_posix())
    folder.mkdir(parents=True, exist_ok=True)
    with appearing_whole(path) as partial:
        write_measurements(partial, table, joints)
        # From here to its document the folder is no campaign; nor may it hold measurements of both kinds.
        for name in (DOCUMENT, CSV, PARQUET):
            (folder / name).unlink(missing_ok=True)
    with appearing_whole(folder / DOCUMENT) as partial, open(partial, "w", encoding="utf-8") as file:
        yaml.safe_dump(document, file, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120)


def _robot_path(name, folder, robots_folder, source):
    known = sorted(file.stem for file in Path(robots_folder).glob("*.yaml"))
    path = Path(robots_folder) / f"{name}.yaml" if name in known else folder / name
    if not path.is_file():
        allowed = (
            f"a file relative to this folder, or a robot of {Path(robots_folder).as_posix()}: {closest_first(name, known)}"
        )
        raise InputError(source, "robot", repr(name), allowed)
    return path


def _targets(described, chain, source):
    points = [point.name for point in chain.points]
    targets = []
    for name, target in described.items():
        if not isinstance(name, str):
            raise InputError(
                source, "targets", f"the name {name!r}, which YAML takes for no text", "a name, in quotes where need be"
            )
        if target["point"] not in points:
            allowed = f"a measuring point of the chain: {closest_first(target['point'], points)}"
            raise InputError(source, f"targets.{name}.point", repr(target["point"]), allowed)
        offset = target["offset_m"]
        targets.append(Target(name, target["point"], None if offset == "unknown" else tuple(map(float, offset))))
    return tuple(targets)


def _holdout(described, folder, source):
    ways = [way for way in HOLDOUTS if way in described]
    drawn = ways in (["fraction"], ["blocks"])
    if len(ways) != 1 or ("seed" in described and not drawn):
        allowed = "one of {fraction, seed}, {blocks, seed}, {session}, {poses} or {campaign}"
        raise InputError(source, "holdout", f"{', '.join(described)} together" if len(described) > 1 else "seed alone", allowed)
    if "campaign" in described and not (folder / described["campaign"] / DOCUMENT).is_file():
        raise InputError(
            source, "holdout.campaign", repr(described["campaign"]), f"a folder with a {DOCUMENT}, relative to this one"
        )
    return {"seed": 1} | described if drawn else dict(described)


def _poses(readings):
    """Sorted (session, pose) pairs (P, 2), and the index of each reading's pair (N,)."""
    pairs = np.column_stack([readings.session, readings.pose])
    first, index = groups_of(pairs)
    return pairs[first], index


def _held_out(holdout, readings, source):
    """Mask (N,) of the readings that are held out."""
    pairs, index = _poses(readings)
    total = len(pairs)
    if "campaign" in holdout:
        if total < FEWEST_TRAINING_POSES:
            raise InputError(source, "holdout", f"{total} poses to fit", f"{FEWEST_TRAINING_POSES} or more poses")
        return np.zeros(len(index), bool)
    chosen = _chosen_poses(holdout, readings, pairs, index, source)
    held_out = int(chosen.sum())
    if total - held_out < FEWEST_TRAINING_POSES or held_out < FEWEST_HELD_OUT_POSES:
        found = f"{total - held_out} poses to fit and {held_out} held out"
        raise InputError(
            source, "holdout", found, f"at least {FEWEST_TRAINING_POSES} to fit and {FEWEST_HELD_OUT_POSES} held out"
        )
    return chosen[index]


def _chosen_poses(holdout, readings, pairs, index, source):
    """Mask (P,) of the poses that are held out; `pairs` and `index` as of `_poses`."""
    total, chosen = len(pairs), np.zeros(len(pairs), bool)
    if "poses" in holdout:
        for entry in holdout["poses"]:
            match = (pairs == entry).all(axis=1) if isinstance(entry, list | tuple) else pairs[:, 1] == entry
            if not match.any():
                raise InputError(
                    source, "holdout.poses", str(entry), f"poses that were measured, {pairs[:, 1].min()}..{pairs[:, 1].max()}"
                )
            chosen |= match
        return chosen
    if "session" in holdout:
        wanted, there = np.atleast_1d(holdout["session"]), np.unique(pairs[:, 0])
        for session in wanted:
            if session not in there:
                raise InputError(
                    source, "holdout.session", str(session), f"sessions that were measured: {', '.join(map(str, there))}"
                )
        return np.isin(pairs[:, 0], wanted)
    draws = np.random.Generator(np.random.PCG64(holdout["seed"]))
    if "blocks" in holdout:
        if holdout["blocks"] > total:
            raise InputError(source, "holdout.blocks", str(holdout["blocks"]), f"at most as many as poses, {total}")
        middle = np.zeros((total, readings.joint_angles.shape[1]))
        np.add.at(middle, index, readings.joint_angles)
        return blocks(middle / np.bincount(index)[:, None], holdout["blocks"]) == draws.integers(holdout["blocks"])
    chosen[draws.permutation(total)[: round(holdout["fraction"] * total)]] = True
    return chosen


def _readings(table, robot, targets):
    reported = table.numbers(table.angles)
    _check_angles(reported, table, robot)
    names = {target.name: index for index, target in enumerate(targets)}
    labels = table.texts("target")
    for index, label in enumerate(labels):
        if label not in names:
            raise table.cell_fault(
                index, "target", shown(label), f"a target of {DOCUMENT}: {closest_first(label, list(names))}"
            )
    approach = None
    if table.has(table.approach):
        senses = table.numbers(table.approach)
        wrong = ~np.isin(senses, (-1.0, 0.0, 1.0))
        if wrong.any():
            index, joint = np.argwhere(wrong)[0]
            raise table.cell_fault(index, table.approach[joint], f"{senses[index, joint]:g}", "-1, 0 or 1")
        # Where a joint of the model follows two reported ones that came from opposite sides, its own sense is not known.
        approach = np.sign(senses @ robot.reported_matrix.T)
    return Readings(
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
        time_s=table.numbers(["time_s"])[:, 0] if table.has(["time_s"]) else None,
        temperature_c=table.numbers(["temperature_c"])[:, 0] if table.has(["temperature_c"]) else None,
        row=table.rows,
    )


def _check_angles(reported, table, robot):
    """Refuse degrees: more turns than a joint has, or far beyond limits that a 57th of the angle keeps."""
    low, high = robot.joint_limits.T
    farthest = max(_FARTHEST_RAD, np.abs(robot.joint_limits).max())

    def inside(reported, margin=0.0):
        angles = robot.model_angles(reported)
        return (angles >= low - margin) & (angles <= high + margin)

    # An angle that its opposite would bring inside the limits has rather a wrong sign, which is for the diagnosis to trace.
    beyond = ~inside(reported, _BEYOND_LIMITS_RAD) & ~inside(-reported, _BEYOND_LIMITS_RAD)
    wrong = (np.abs(reported) > farthest) | (beyond & inside(np.radians(reported)))
    if wrong.any():
        index, joint = np.argwhere(wrong)[0]
        allowed = (
            f"rad, not degrees, of a joint that goes from {low[joint]:.2f} to {high[joint]:.2f} rad"
            " (counted otherwise: reported_joints of the robot file)"
        )
        raise table.cell_fault(index, table.angles[joint], f"{reported[index, joint]:g}", allowed)


def _check_readings(readings, table, robot, targets, source):
    _check_duplicates(readings, table, targets)
    _check_loads(readings, table)
    _check_poses(readings, table)
    _check_units(readings, table, robot, targets)
    for index, target in enumerate(targets):
        if not (readings.target == index).any():
            raise InputError(
                source, f"targets.{target.name}", "no reading of it", f"targets that {Path(table.path).name} has readings of"
            )


def _check_duplicates(readings, table, targets):
    key = np.column_stack([readings.session, readings.pose, readings.load, readings.repeat, readings.target])
    first, group = groups_of(key)
    again = first[group] != np.arange(len(readings))
    if again.any():
        index = int(np.argmax(again))
        session, pose, load, repeat, target = key[index]
        of_session = f"session {session}, " if "session" in table.columns else ""
        found = f"{of_session}pose {pose}, load {load}, repeat {repeat}, target {targets[target].name} again"
        earlier = table.rows[first[group[index]]]
        raise table.fault(f"row {table.rows[index]}", found, f"each once (first in row {earlier})")


def _check_loads(readings, table):
    unloaded = readings.load == 0
    if not table.has(table.wrench) and not unloaded.all():
        index = int(np.argmin(unloaded))
        raise table.cell_fault(
            index, "load", str(readings.load[index]), f"0 where there are no columns {', '.join(table.wrench)}"
        )
    wrong = unloaded[:, None] & (readings.wrench != 0)
    if wrong.any():
        index, component = np.argwhere(wrong)[0]
        raise table.cell_fault(
            index, table.wrench[component], f"{readings.wrench[index, component]:g} with load 0", "0 where load is 0"
        )


def _check_poses(readings, table):
    pairs, pose_of = _poses(readings)
    first = np.full(len(pairs), len(readings))
    np.minimum.at(first, pose_of, np.arange(len(readings)))
    reported = table.numbers(table.angles)
    away = np.abs(reported - reported[first[pose_of]])
    wrong = away > _SAME_POSE_RAD
    if wrong.any():
        index, joint = np.argwhere(wrong)[0]
        earlier = table.rows[first[pose_of[index]]]
        found = f"{reported[index, joint]:g}, {away[index, joint]:.3g} rad from row {earlier} of the same pose"
        raise table.cell_fault(index, table.angles[joint], found, f"readings of one pose within {_SAME_POSE_RAD} rad")


def _check_units(readings, table, robot, targets):
    tool = max((np.linalg.norm(target.offset_m) for target in targets if target.offset_m is not None), default=_LONGEST_TOOL_M)
    reach = tool + sum(abs(transform.constant) for transform in robot.chain.transforms if transform.kind == "T")
    for session in np.unique(readings.session):
        members = np.flatnonzero(readings.session == session)
        position = readings.position[members]
        away = np.abs(position - np.median(position, axis=0))
        if away.max() > _FARTHEST_REACHES * reach:
            index, axis = np.unravel_index(np.argmax(away), away.shape)
            found = f"{position[index, axis]:g}, {away[index, axis]:.4g} from the middle of the readings"
            raise table.cell_fault(
                members[index], "xyz"[axis], found, f"metres, not millimetres; the robot reaches {reach:.3g} m"
            )
    if readings.rotation_vector is not None:
        angle = np.linalg.norm(readings.rotation_vector, axis=1)
        if angle.max() > _FARTHEST_RAD:
            index = int(np.argmax(angle))
            raise table.cell_fault(
                index, "rx, ry, rz", f"a turn of {angle[index]:.4g}", "a rotation vector in rad, not degrees"
            )
