"""The robot file of a robot that was imported from a file of another format.

Fixed transforms become tokens of the chain notation. A rigid displacement becomes ``Tx Ty
Tz Rz Ry Rx``, with its rotation as yaw, pitch and roll; elementary transforms of zero
size are omitted.
"""

import hashlib
import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from elastocal.counting import format_count
from elastocal.errors import InputError, describe_os_error
from elastocal.io.atomic_writes import check_places, write_text
from elastocal.io.documents import check_document, format_one_line
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import parse_robot

# Column of a robot file at which comments, the chain and limits are wrapped. Other entries
# are not: a name may contain several blanks in a row, which wrapping would join.
_WIDTH = 128
_WRAPPED = ("chain", "joint_limits_deg")
# Upper bound on the turns of an angle. A joint may count many turns; a thousand are a
# mistake.
LARGEST_TURNS = 1000
# Decimals of lengths (m) and angles (deg): picometres, and as many degrees. The rounding
# errors of a long chain add up to far less than a nanometre, and cos(90 deg) becomes 0.
_DECIMALS = 12


@dataclass(frozen=True)
class ImportedRobot:
    """A robot that was imported from a file of another format.

    Attributes
    ----------
    document : contents of its robot file.
    robot : the robot that this file describes.
    origin : sentence that states the source file, its digest and the import options.
    notes : assumptions that were made, and what the robot file lacks.
    """

    document: dict[str, Any]
    robot: Robot
    origin: str
    notes: tuple[str, ...]


@dataclass(frozen=True)
class AxisTokens:
    """Chain notation of a joint that moves about or along an axis.

    The chain has joints about x, y and z only. A joint with an oblique axis moves about z,
    between a fixed rotation and its inverse.

    Attributes
    ----------
    before : tokens of the rotation that turns z into the axis; empty for x, y and z.
    letter : axis of the joint in the rotated frame.
    sign : "-" if the joint moves about the negative axis, otherwise "".
    after : tokens of the rotation back.
    rotation : fixed rotation before the joint, (3, 3).
    """

    before: list[str]
    letter: str
    sign: str
    after: list[str]
    rotation: np.ndarray


def check_imported(
    document: dict[str, Any], path: str | Path, options: str, notes: Sequence[str]
) -> ImportedRobot:
    """Check the contents of a robot file that were made from a file of another format.

    Parameters
    ----------
    document : contents of the robot file
    path : file from which they were made
    options : how that file was read, for the sentence about the origin
    notes : assumptions that were made

    Raises
    ------
    InputError
        A robot file cannot describe such a robot.
    """
    source = Path(path).as_posix()
    check_document(document, "robot", source)
    robot = parse_robot(document, source)
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    missing = []
    if not robot.compliance_known:
        missing.append(
            "no compliances: set `compliance: identify` in campaign.yaml, or write them"
            " here"
        )
    if robot.payload_kg is None:
        missing.append("no rated load (payload_kg)")
    origin = f"From {Path(path).name} (sha256 {digest[:16]}), {options}."
    return ImportedRobot(document, robot, origin, (*notes, *missing))


def format_point_name(link: str) -> str:
    """Format the name of a link as that of a measuring point.

    Blanks and brackets become underscores, because the chain notation needs them.
    """
    return re.sub(r"[\[\]\s]", "_", link)


def format_robot_file(imported: ImportedRobot) -> str:
    """Format the text of a robot file, with origin and notes as comments."""
    comments = [imported.origin]
    comments += [f"{note[:1].upper()}{note[1:]}." for note in imported.notes]
    lines: list[str] = []
    for comment in comments:
        # The name of a file may hold a line break, which would end the comment.
        printable = "".join(
            character if character.isprintable() else "?" for character in comment
        )
        lines += textwrap.wrap(
            printable,
            _WIDTH,
            initial_indent="# ",
            subsequent_indent="# ",
            break_on_hyphens=False,
        )
    for key, value in imported.document.items():
        entry = f"{key}: {format_one_line(value)}"
        if key == "masses":
            lines += ["masses:", *(f"  - {format_one_line(mass)}" for mass in value)]
        elif key in _WRAPPED:
            lines += textwrap.wrap(
                entry,
                _WIDTH,
                subsequent_indent="  ",
                break_on_hyphens=False,
                break_long_words=False,
            )
        else:
            lines.append(entry)
    return "\n".join([*lines, ""])


def write_robot(imported: ImportedRobot, path: str | Path) -> None:
    """Write a robot file, which appears complete or not at all.

    Raises `InputError` if the file cannot be written.
    """
    try:
        write_text(path, format_robot_file(imported))
    except OSError as error:
        raise InputError(
            path, "", describe_os_error(error), "a place for a file"
        ) from None


def summarize_import(imported: ImportedRobot) -> list[str]:
    """Summarize an imported robot and its notes in a few lines."""
    robot = imported.robot
    joints = format_count(robot.joints, "joint")
    prismatic = sum(robot.chain.prismatic)
    if prismatic:
        joints += f", {prismatic} of them prismatic"
    if robot.has_followers:
        joints += f", {robot.commands} of them commanded"
    length = math.fsum(
        abs(transform.constant)
        for transform in robot.chain.transforms
        if transform.kind == "T"
    )
    weight = ""
    if robot.masses:
        weight = f", {math.fsum(mass.mass_kg for mass in robot.masses):.4g} kg"
    points = ", ".join(point.name for point in robot.chain.points)
    return [
        imported.origin,
        f"{robot.name}: {joints}, {length:.4g} m stretched out{weight}",
        f"measuring points: {points}",
        *(f"note: {note}" for note in imported.notes),
    ]


def refuse_existing(path: str | Path, *, force: bool) -> None:
    """Refuse an output path that is a folder or in no folder, and, unless `force`, one
    that exists already."""
    if Path(path).is_dir() or not Path(path).resolve().parent.is_dir():
        raise InputError(
            path, "", "no place for a file", "a file in an existing folder"
        )
    check_places(path)
    if Path(path).exists() and not force:
        raise InputError(
            path,
            "",
            "a file that exists already",
            "another --output, or --force to replace it",
        )


def format_displacement(transform: np.ndarray) -> list[str]:
    """Format a homogeneous transform (4, 4) in tokens of the chain notation."""
    return format_tokens(
        [
            *zip(("Tx", "Ty", "Tz"), transform[:3, 3], strict=True),
            *zip(
                ("Rz", "Ry", "Rx"),
                compute_yaw_pitch_roll(transform[:3, :3]),
                strict=True,
            ),
        ]
    )


def format_tokens(transforms: Iterable[tuple[str, float]]) -> list[str]:
    """Format elementary transforms, such as ``Tx(0.5)`` and ``Rx(90deg)``.

    `transforms` are names with amounts, in m for ``T`` and rad for ``R``. Transforms
    whose amount rounds to zero are omitted.
    """
    tokens = []
    for name, amount in transforms:
        unit = ""
        if name.startswith("R"):
            amount = math.degrees(amount)
            unit = "deg"
        amount = round(amount, _DECIMALS)
        if amount:
            number = np.format_float_positional(amount, trim="-")
            tokens.append(f"{name}({number}{unit})")
    return tokens


def express_axis(axis: np.ndarray) -> AxisTokens:
    """Express the axis of a joint, (3,) and not zero, in the chain notation."""
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    largest = int(np.argmax(np.abs(unit)))
    if np.abs(np.delete(unit, largest)).max() < 10.0**-_DECIMALS:
        sign = "-" if unit[largest] < 0 else ""
        return AxisTokens([], "xyz"[largest], sign, [], np.eye(3))
    yaw = math.atan2(unit[1], unit[0])
    pitch = math.atan2(math.hypot(unit[0], unit[1]), unit[2])
    # The rotation has the rounded angles of its tokens.
    rounded = [round(math.degrees(angle), _DECIMALS) for angle in (yaw, pitch)]
    rotation = Rotation.from_euler("ZY", np.radians(rounded)).as_matrix()
    before = format_tokens([("Rz", yaw), ("Ry", pitch)])
    after = format_tokens([("Ry", -pitch), ("Rz", -yaw)])
    return AxisTokens(before, "z", "", after, rotation)


def compute_yaw_pitch_roll(rotation: np.ndarray) -> tuple[float, float, float]:
    """Compute the angles of R (3, 3) = Rz(yaw) Ry(pitch) Rx(roll), rad.

    Near a pitch of 90 deg, yaw and roll are not separate. The roll is therefore computed
    from Rz(-yaw) R, so that the product is right.
    """
    cos_pitch = math.hypot(rotation[0, 0], rotation[1, 0])
    yaw = 0.0
    if cos_pitch > 10.0**-_DECIMALS:
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    unyawed = Rotation.from_euler("z", -yaw).as_matrix() @ rotation
    pitch = math.atan2(-rotation[2, 0], cos_pitch)
    return yaw, pitch, math.atan2(-unyawed[1, 2], unyawed[1, 1])


def make_elementary_transform(kind: str, axis: int, amount: float) -> np.ndarray:
    """Make a shift (``T``, m) along or a rotation (``R``, rad) about an axis, 0 to 2, as
    (4, 4) array."""
    vector = amount * np.eye(3)[axis]
    if kind == "R":
        return make_transform(Rotation.from_rotvec(vector).as_matrix())
    return make_transform(np.eye(3), vector)


def make_transform(
    rotation: np.ndarray, shift: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """Make a homogeneous transform (4, 4) of a rotation (3, 3) and a shift (3,)."""
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = shift
    return transform


def make_origin_transform(xyz: Sequence[float], rpy: Sequence[float]) -> np.ndarray:
    """Make the homogeneous transform (4, 4) of an origin in a URDF: a shift (m), then a
    rotation by roll, pitch and yaw (rad)."""
    return make_transform(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)
