"""A robot that was read of a file of another kind: its fixed transforms in words of the
chain notation, and its robot file.

A rigid displacement becomes ``Tx Ty Tz Rz Ry Rx``, the rotation by yaw, pitch and roll;
what is zero is left out.
"""

import hashlib
import math
import re
import textwrap
from collections.abc import Sequence
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

_WIDTH = 128
# A joint may count any number of turns; a thousand are a mistake.
MOST_TURNS = 1000
# Picometres, and as many degrees: a chain of any length keeps to far less than a
# nanometre, and cos(90 deg) is no length.
_DECIMALS = 12


@dataclass(frozen=True)
class Imported:
    """A robot that was read of a file of another kind.

    `document`: contents of its robot file. `robot`: the same, as it is used. `origin`:
    where it came from: file, digest and options, in a sentence. `notes`: what is to be
    known of it, and what it lacks.
    """

    document: dict[str, Any]
    robot: Robot
    origin: str
    notes: tuple[str, ...]


def check_imported(
    document: dict[str, Any], path: str | Path, options: str, notes: Sequence[str]
) -> Imported:
    """Check the contents of a robot file that were made from another file, `path`,
    which was read as `options` say.

    An InputError refuses a robot that no robot file may describe.
    """
    source = Path(path).as_posix()
    check_document(document, "robot", source)
    robot = parse_robot(document, source)
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    missing = ["no rated load (payload_kg)"] if robot.payload_kg is None else []
    if not robot.compliance_known:
        missing.insert(
            0,
            "no compliances: set `compliance: identify` in campaign.yaml, or write them here",
        )
    origin = f"From {Path(path).name} (sha256 {digest[:16]}), {options}."
    return Imported(document, robot, origin, (*notes, *missing))


def point_name(link: str) -> str:
    """A link's name as that of a measuring point: blanks and brackets, which the
    notation needs, become underscores."""
    return re.sub(r"[\[\]\s]", "_", link)


def robot_text(result: Imported) -> str:
    """The text of a robot file."""
    head = []
    for text in (
        result.origin,
        *(f"{note[:1].upper()}{note[1:]}." for note in result.notes),
    ):
        # Whatever a file's name holds stays inside of a comment.
        plain = "".join(
            character if character.isprintable() else "?" for character in text
        )
        head += textwrap.wrap(
            plain,
            _WIDTH,
            initial_indent="# ",
            subsequent_indent="# ",
            break_on_hyphens=False,
        )
    body: list[str] = []
    for key, value in result.document.items():
        if key == "masses":
            body += ["masses:", *(f"  - {format_one_line(entry)}" for entry in value)]
        else:
            # A name may have blanks that a break of the line would join.
            width = _WIDTH if key in ("chain", "joint_limits_deg") else 10**6
            line = f"{key}: {format_one_line(value)}"
            body += textwrap.wrap(
                line,
                width,
                subsequent_indent="  ",
                break_on_hyphens=False,
                break_long_words=False,
            )
    return "\n".join([*head, *body, ""])


def write_robot(result: Imported, path: str | Path) -> None:
    """Write a robot file, which appears whole or not at all; a place that cannot be
    written to is refused."""
    try:
        write_text(path, robot_text(result))
    except OSError as error:
        raise InputError(
            path, "", describe_os_error(error), "a place for a file"
        ) from None


def summary(result: Imported) -> list[str]:
    """What was read, and what is to be known of it, in a few lines."""
    robot = result.robot
    shifts = sum(robot.chain.prismatic)
    kinds = format_count(robot.joints, "joint") + (
        f", {shifts} of them prismatic" if shifts else ""
    )
    reach = math.fsum(abs(t.constant) for t in robot.chain.transforms if t.kind == "T")
    weight = math.fsum(mass.mass_kg for mass in robot.masses)
    return [
        result.origin,
        f"{robot.name}: {kinds}, {reach:.4g} m stretched out{f', {weight:.4g} kg' if robot.masses else ''}",
        f"measuring points: {', '.join(point.name for point in robot.chain.points)}",
        *(f"note: {note}" for note in result.notes),
    ]


def refuse_existing(path: str | Path, force: bool) -> None:
    """Refuse a path where something is already, but for a file with `force`."""
    if Path(path).is_dir() or not Path(path).resolve().parent.is_dir():
        raise InputError(
            path, "", "no place for a file", "a file in a folder that is there"
        )
    check_places(path)
    if Path(path).exists() and not force:
        raise InputError(
            path,
            "",
            "a file that is there already",
            "another --output, or --force to replace it",
        )


def displacement_words(transform: np.ndarray) -> list[str]:
    """A homogeneous transform (4, 4) in words."""
    amounts = dict(zip(("Tx", "Ty", "Tz"), transform[:3, 3], strict=True))
    amounts |= dict(
        zip(("Rz", "Ry", "Rx"), yaw_pitch_roll(transform[:3, :3]), strict=True)
    )
    return [text for name, amount in amounts.items() if (text := word(name, amount))]


def word(name: str, amount: float) -> str:
    """``Tx(0.5)`` of m, ``Rx(90deg)`` of rad; empty for nothing."""
    turns = name.startswith("R")
    amount = round(math.degrees(amount) if turns else amount, _DECIMALS)
    text = np.format_float_positional(abs(amount), trim="-")
    return (
        f"{name}({'-' if amount < 0 else ''}{text}{'deg' if turns else ''})"
        if amount
        else ""
    )


def express_axis(axis: np.ndarray) -> tuple[list[str], str, str, list[str], np.ndarray]:
    """A joint's axis (3,), not zero, as one of the chain's, between a fixed rotation
    and its inverse where it is oblique.

    Returns `before`: words of the rotation that turns z into the axis, empty for x, y
    and z; `letter`, `sign`: of the axis then, and "-" or ""; `after`: words of the
    rotation back; the fixed rotation before, as a matrix (3, 3).
    """
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    along = int(np.argmax(np.abs(unit)))
    if np.abs(np.delete(unit, along)).max() < 10.0**-_DECIMALS:
        return [], "xyz"[along], "-" if unit[along] < 0 else "", [], np.eye(3)
    turns = [
        ("Rz", math.atan2(unit[1], unit[0])),
        ("Ry", math.atan2(math.hypot(unit[0], unit[1]), unit[2])),
    ]
    before = [text for name, angle in turns if (text := word(name, angle))]
    after = [text for name, angle in reversed(turns) if (text := word(name, -angle))]
    angles = [math.radians(round(math.degrees(angle), _DECIMALS)) for _, angle in turns]
    return before, "z", "", after, Rotation.from_euler("ZY", angles).as_matrix()


def yaw_pitch_roll(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles of R (3, 3) = Rz(yaw) Ry(pitch) Rx(roll), rad.

    Near a pitch of 90 deg yaw and roll are not separate; the roll is read of what the
    yaw leaves, so that the product is right.
    """
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    yaw = (
        math.atan2(rotation[1, 0], rotation[0, 0]) if level > 10.0**-_DECIMALS else 0.0
    )
    rest = Rotation.from_euler("z", -yaw).as_matrix() @ rotation
    return yaw, math.atan2(-rotation[2, 0], level), math.atan2(-rest[1, 2], rest[1, 1])


def elementary(kind: str, axis: int, amount: float) -> np.ndarray:
    """Shift (``T``, m) along or turn (``R``, rad) about an axis, 0 to 2, ndarray (4,
    4)."""
    along = amount * np.eye(3)[axis]
    return (
        homogeneous(Rotation.from_rotvec(along).as_matrix())
        if kind == "R"
        else homogeneous(np.eye(3), along)
    )


def homogeneous(
    rotation: np.ndarray, shift: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """A turn (3, 3) and a shift (3,) as one, ndarray (4, 4)."""
    found = np.eye(4)
    found[:3, :3] = rotation
    found[:3, 3] = shift
    return found


def origin_transform(xyz: Sequence[float], rpy: Sequence[float]) -> np.ndarray:
    """Shift (m), then turn by roll, pitch and yaw (rad) as the origin of a URDF has
    them, ndarray (4, 4)."""
    return homogeneous(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)
