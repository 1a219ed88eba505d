"""A robot file of a robot that was read of a file of another kind: checked, written, and summed up for a person."""

import hashlib
import math
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elastocal.counting import counted
from elastocal.errors import InputError, reason_of
from elastocal.io.atomic_writes import check_places, write_text
from elastocal.io.documents import check_document, one_line
from elastocal.mechanics.robot import Robot
from elastocal.mechanics.robot_file import robot_from_document

_WIDTH = 128
# A joint may count any number of turns; a thousand are a mistake.
MOST_TURNS = 1000


@dataclass(frozen=True)
class Imported:
    """A robot that was read of a file of another kind.

    `document`: contents of its robot file. `robot`: the same, as it is used. `origin`: where it came from: file, digest and
    options, in a sentence. `notes`: what is to be known of it, and what it lacks.
    """

    document: dict[str, Any]
    robot: Robot
    origin: str
    notes: tuple[str, ...]


def check_imported(document: dict[str, Any], path: str | Path, options: str, notes: Sequence[str]) -> Imported:
    """Check the contents of a robot file that were made from another file, `path`, which was read as `options` say.

    An InputError refuses a robot that no robot file may describe.
    """
    source = Path(path).as_posix()
    check_document(document, "robot", source)
    robot = robot_from_document(document, source)
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    missing = ["no rated load (payload_kg)"] if robot.payload_kg is None else []
    if not robot.compliance_known:
        missing.insert(0, "no compliances: set `compliance: identify` in campaign.yaml, or write them here")
    origin = f"From {Path(path).name} (sha256 {digest[:16]}), {options}."
    return Imported(document, robot, origin, (*notes, *missing))


def point_name(link: str) -> str:
    """A link's name as that of a measuring point: blanks and brackets, which the notation needs, become underscores."""
    return re.sub(r"[\[\]\s]", "_", link)


def robot_text(result: Imported) -> str:
    """The text of a robot file."""
    head = []
    for text in (result.origin, *(f"{note[:1].upper()}{note[1:]}." for note in result.notes)):
        # Whatever a file's name holds stays inside of a comment.
        plain = "".join(character if character.isprintable() else "?" for character in text)
        head += textwrap.wrap(plain, _WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)
    body: list[str] = []
    for key, value in result.document.items():
        if key == "masses":
            body += ["masses:", *(f"  - {one_line(entry)}" for entry in value)]
        else:
            # A name may have blanks that a break of the line would join.
            width = _WIDTH if key in ("chain", "joint_limits_deg") else 10**6
            line = f"{key}: {one_line(value)}"
            body += textwrap.wrap(line, width, subsequent_indent="  ", break_on_hyphens=False, break_long_words=False)
    return "\n".join([*head, *body, ""])


def write_robot(result: Imported, path: str | Path) -> None:
    """Write a robot file, which appears whole or not at all; a place that cannot be written to is refused."""
    try:
        write_text(path, robot_text(result))
    except OSError as error:
        raise InputError(path, "", reason_of(error), "a place for a file") from None


def summary(result: Imported) -> list[str]:
    """What was read, and what is to be known of it, in a few lines."""
    robot = result.robot
    shifts = sum(robot.chain.prismatic)
    kinds = counted(robot.joints, "joint") + (f", {shifts} of them prismatic" if shifts else "")
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
        raise InputError(path, "", "no place for a file", "a file in a folder that is there")
    check_places(path)
    if Path(path).exists() and not force:
        raise InputError(path, "", "a file that is there already", "another --output, or --force to replace it")
