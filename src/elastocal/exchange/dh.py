"""A Denavit-Hartenberg table to the contents of a robot file.

A row of the standard notation [1] is ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, one of Craig's modified notation [2]
``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` with the alpha and a of its own row, which he calls alpha and a of i - 1. A joint's angle is
added to theta, a prismatic joint's shift to d.

Joint frames may be moved along their own axes, which changes no pose behind them: a turn about z and a shift along z commute,
``Tz(s) Rz(q) Tz(-s) = Rz(q)``, and so for ``Tz(q)``. Where two axes are nearly parallel, their common normal is anywhere along
them, and a calibrated table has lengths d of hundreds of metres that cancel [3]; the frames of a chain need not be there.

[1] Denavit, J. and Hartenberg, R. S., A kinematic notation for lower-pair mechanisms based on matrices, Journal of Applied
    Mechanics 22, 1955.
[2] Craig, J. J., Introduction to Robotics: Mechanics and Control, Addison-Wesley, 1986.
[3] Hayati, S., Robot arm geometric link parameter estimation, 22nd IEEE Conference on Decision and Control, 1983.
"""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.dh_table import AS_STATED, FIXED, PRISMATIC, REVOLUTE, DhOptions, DhRow, read_dh_table
from elastocal.exchange.fixed_transforms import displacement_words, elementary, shift_word, turn_word
from elastocal.exchange.mass_deviations import OF_TABLE
from elastocal.exchange.robot_text import Imported, check_imported, mass_entries
from elastocal.exchange.ros_kinematics import KINEMATICS, robot_from_kinematics
from elastocal.exchange.urdf_chain import point_name
from elastocal.io.documents import read_document
from elastocal.mechanics.usual_values import UNLIMITED_DEG

END = "flange"
_DECIMALS = 9
# Calibrated tables have lengths along nearly parallel axes, by hundreds of metres, that cancel.
_MUCH_SHORTER = 0.5
# A displacement, ndarray (4, 4), and the measuring point at its end; empty for none.
_Piece = tuple[np.ndarray, str]
_SHIFT = re.compile(r"T[xyz]\((-?[0-9.]+)\)", re.ASCII)


def robot_from_dh(
    path: str | Path,
    modified: bool = False,
    options: DhOptions = AS_STATED,
    name: str | None = None,
    relative_std: float = OF_TABLE,
) -> Imported:
    """The robot of a Denavit-Hartenberg table, or of a YAML file of `ros_kinematics`.

    `modified`: Craig's notation; else the standard one. `options`: as in `read_dh_table`. `name`: of the robot; that of the
    file without. `relative_std`: how well masses are known. Raises `InputError`: as in `read_dh_table`;
    compliances of some joints only, a prismatic joint without limits, two points of one name.
    """
    source = Path(path).as_posix()
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        described = read_document(path)
        if isinstance(described, dict) and KINEMATICS in described:
            if modified:
                raise InputError("--modified", "", f"a file of {KINEMATICS}, which is no table", "the file without --modified")
            if options.ignore:
                allowed = "the file without --ignore"
                raise InputError("--ignore", "", f"a file of {KINEMATICS}, of which nothing is left out", allowed)
            return robot_from_kinematics(described, path, name)
    rows, understood = read_dh_table(path, options)
    joints = [row for row in rows if row.kind != FIXED]
    points = [point_name(row.point) if row.point else "" for row in rows]
    points[-1] = points[-1] or END
    document: dict[str, Any] = {"name": name or Path(path).stem}
    if names := _joint_names(joints, source):
        document["joint_names"] = names
    words, slid = _words(rows, points, modified), np.zeros(len(joints) + 1)
    near, slides = _slid_words(_gaps(rows, points, modified), [row.kind for row in joints])
    written, short = _lengths_of(words), _lengths_of(near)
    if short < _MUCH_SHORTER * written:
        words, slid = near, slides
    document["chain"] = " ".join(words)
    if any(row.limits or row.kind == PRISMATIC for row in joints):
        document["joint_limits_deg"] = [_limits(row, source) for row in joints]
    compliances = [row.compliance for row in joints]
    if None not in compliances:
        document["compliance_urad_per_Nm"] = compliances
    elif any(compliances):
        row = joints[compliances.index(None)]
        raise InputError(source, f"{row.where}, compliance_urad_per_Nm", "nothing", "one for every joint, or for none")
    masses = _masses(rows, modified, relative_std, slid)
    notes = [] if masses else ["no masses: the weight of the links is not known"]
    if slid.any():
        notes.append(
            f"lengths of {written:.4g} m that cancel along nearly parallel axes became {short:.4g} m in the chain, "
            "whose joints are at other places of the same axes: the pose at the end is the same"
        )
    if masses:
        document["masses"] = masses
        notes.append(f"masses are known to {100 * relative_std:g} %, by assumption")
    if free := [str(number) for number, row in enumerate(joints, 1) if row.limits is None]:
        notes.append(f"no limits of q{', q'.join(free)}: a turn either way")
    notation = f"{'modified' if modified else 'standard'} Denavit-Hartenberg parameters"
    return check_imported(document, path, notation, [*understood, *notes])


def _words(rows: Sequence[DhRow], points: Sequence[str], modified: bool) -> list[str]:
    words: list[str | None] = []
    joint = 0
    for row, point in zip(rows, points, strict=True):
        across = [shift_word("x", row.a), turn_word("x", row.alpha)]
        along = [turn_word("z", row.theta), None, None, shift_word("z", row.d)]
        if row.kind != FIXED:
            joint += 1
            along[1 if row.kind == REVOLUTE else 2] = f"{'R' if row.kind == REVOLUTE else 'T'}z(q{joint})"
        # Rx and Tx commute, and so do Rz and Tz: a joint stands before its own d, where the standard notation has it.
        words += [*across, *along] if modified else [*along, *across]
        words.append(f"[{point}]" if point else None)
    return [word for word in words if word]


def _joint_names(joints: Sequence[DhRow], source: str) -> list[str]:
    """What the table calls the joints; nothing where it only counts them."""
    names = [row.joint for row in joints]
    if not any(names) or all(name.isdecimal() for name in names):
        return []
    for row in joints:
        if not row.joint or names.count(row.joint) > 1:
            raise InputError(source, f"{row.where}, joint", repr(row.joint), "a name for every joint, each once")
    return names


def _limits(row: DhRow, source: str) -> list[float]:
    if row.limits is None and row.kind == PRISMATIC:
        raise InputError(source, f"{row.where}, lower and upper", "nothing", "limits of a prismatic joint")
    if row.limits is None:
        return list(UNLIMITED_DEG)
    return [round(value if row.kind == PRISMATIC else math.degrees(value), _DECIMALS) for value in row.limits]


def _gaps(rows: Sequence[DhRow], points: Sequence[str], modified: bool) -> list[list[_Piece]]:
    """What stands before, between and behind the joints: displacements, each with the point at its end."""
    gaps: list[list[_Piece]] = [[]]
    for row, point in zip(rows, points, strict=True):
        before, behind = _displacements(row, modified)
        if row.kind == FIXED:
            gaps[-1].append((before @ behind, point))
        else:
            gaps[-1].append((before, ""))
            gaps.append([(behind, point)])
    return gaps


def _masses(rows: Sequence[DhRow], modified: bool, relative_std: float, slid: np.ndarray) -> list[dict[str, Any]]:
    """Masses of each link, that of fixed rows with the joint before; centres in the frame directly behind the joint.

    `slid` (n + 1,) is by how much the frame of each link is moved along z from where the table has it (m).
    """
    body, here = 0, np.eye(4)
    moments: dict[int, np.ndarray] = {}
    for row in rows:
        before, behind = _displacements(row, modified)
        if row.kind == FIXED:
            here = here @ before
        else:
            body, here = body + 1, elementary("T", 2, -slid[body + 1])
        here = here @ behind
        if row.mass_kg is not None:
            moments[body] = moments.get(body, np.zeros(4)) + row.mass_kg * here @ np.append(row.centre_m, 1.0)
    return mass_entries(moments, relative_std)


def _displacements(row: DhRow, modified: bool) -> tuple[np.ndarray, np.ndarray]:
    """What of a row stands before its joint, and what behind, ndarray (4, 4) each."""
    across = elementary("T", 0, row.a) @ elementary("R", 0, row.alpha)
    turn, shift = elementary("R", 2, row.theta), elementary("T", 2, row.d)
    return (across @ turn, shift) if modified else (turn, shift @ across)


def _lengths_of(words: Sequence[str]) -> float:
    """Sum of all fixed lengths of a chain, m."""
    return sum(abs(float(match[1])) for word in words if (match := _SHIFT.fullmatch(word)))


def _slid_words(gaps: Sequence[Sequence[_Piece]], kinds: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """A chain in words whose joints lie as near as their axes allow to the joint before, and how far each was moved.

    `gaps`: displacements before, between and behind n joints, which move about or along z. `kinds` (n,) of str: ``P`` of
    prismatic joints. Returns `slides` (n + 1,): m along z of each joint, and 0 before for the base.
    """
    words: list[str] = []
    slides = np.zeros(len(gaps))
    for number, gap in enumerate(gaps):
        here = elementary("T", 2, -slides[number])
        for place, (piece, point) in enumerate(gap):
            here = here @ piece
            last = place == len(gap) - 1 and number < len(kinds)
            if last:
                # Of the points of the next axis the nearest one.
                slides[number + 1] = -here[:3, 2] @ here[:3, 3]
                here = here @ elementary("T", 2, slides[number + 1])
            if point or last or place == len(gap) - 1:
                words += displacement_words(here)
                words += [f"[{point}]"] if point else []
                here = np.eye(4)
        if number < len(kinds):
            words.append(f"{'T' if kinds[number] == 'P' else 'R'}z(q{number + 1})")
    return words, slides
