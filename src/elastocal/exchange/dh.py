"""A Denavit-Hartenberg table to the contents of a robot file.

A row of the standard notation [1] is ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, one of Craig's modified notation [2]
``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` with the alpha and a of its own row, which he calls alpha and a of i - 1. A joint's angle is
added to theta, a prismatic joint's shift to d.

[1] Denavit, J. and Hartenberg, R. S., A kinematic notation for lower-pair mechanisms based on matrices, Journal of Applied
    Mechanics 22, 1955.
[2] Craig, J. J., Introduction to Robotics: Mechanics and Control, Addison-Wesley, 1986.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.errors import InputError
from elastocal.exchange.dh_table import AS_STATED, FIXED, PRISMATIC, REVOLUTE, DhOptions, DhRow, read_dh_table
from elastocal.exchange.fixed_transforms import rotation_about, shift_word, turn_word
from elastocal.exchange.robot_text import Imported, imported
from elastocal.exchange.ros_kinematics import KINEMATICS, robot_from_kinematics
from elastocal.exchange.slid_frames import Piece, lengths_of, slid_words
from elastocal.exchange.urdf_chain import point_name
from elastocal.io.documents import read_document
from elastocal.mechanics.usual_values import UNLIMITED_DEG

# A table with masses is a maker's or was identified; a tenth is what such masses are known to at best.
RELATIVE_STD = 0.1
END = "flange"
_DECIMALS = 9
# Calibrated tables have lengths along nearly parallel axes, by hundreds of metres, that cancel.
_MUCH_SHORTER = 0.5


def robot_from_dh(
    path: str | Path,
    modified: bool = False,
    options: DhOptions = AS_STATED,
    name: str | None = None,
    relative_std: float = RELATIVE_STD,
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
                raise InputError(
                    "--ignore", "", f"a file of {KINEMATICS}, of which nothing is left out", "the file without --ignore"
                )
            return robot_from_kinematics(described, path, name)
    rows, understood = read_dh_table(path, options)
    joints = [row for row in rows if row.kind != FIXED]
    points = [point_name(row.point) if row.point else "" for row in rows]
    points[-1] = points[-1] or END
    document: dict[str, Any] = {"name": name or Path(path).stem}
    if names := _joint_names(joints, source):
        document["joint_names"] = names
    words, slid = _words(rows, points, modified), np.zeros(len(joints) + 1)
    near, slides = slid_words(_gaps(rows, points, modified), [row.kind for row in joints])
    written, short = lengths_of(words), lengths_of(near)
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
    return imported(document, path, notation, [*understood, *notes])


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


def _gaps(rows: Sequence[DhRow], points: Sequence[str], modified: bool) -> list[list[Piece]]:
    """What stands before, between and behind the joints: displacements, each with the point at its end."""
    gaps: list[list[Piece]] = [[]]
    for row, point in zip(rows, points, strict=True):
        before, behind = (np.vstack([np.column_stack(part), [0.0, 0.0, 0.0, 1.0]]) for part in _displacements(row, modified))
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
    body, rotation, position = 0, np.eye(3), np.zeros(3)
    moments: dict[int, np.ndarray] = {}
    for row in rows:
        before, behind = _displacements(row, modified)
        if row.kind == FIXED:
            rotation, position = _behind(rotation, position, before)
        else:
            body, rotation, position = body + 1, np.eye(3), np.array([0.0, 0.0, -slid[body + 1]])
        rotation, position = _behind(rotation, position, behind)
        if row.mass_kg is not None:
            centre = position + rotation @ np.array(row.centre_m)
            moments[body] = moments.get(body, np.zeros(4)) + row.mass_kg * np.append(centre, 1.0)
    return [
        {
            "link": link,
            "mass_kg": round(float(moment[3]), _DECIMALS),
            "centre_m": (np.round(moment[:3] / moment[3], _DECIMALS) + 0.0).tolist(),
            "relative_std": relative_std,
        }
        for link, moment in sorted(moments.items())
    ]


_Displacement = tuple[np.ndarray, np.ndarray]


def _displacements(row: DhRow, modified: bool) -> tuple[_Displacement, _Displacement]:
    """What of a row stands before its joint, and what behind, as rotation and position."""
    across = rotation_about("x", row.alpha), np.array([row.a, 0.0, 0.0])
    turn, shift = (rotation_about("z", row.theta), np.zeros(3)), (np.eye(3), np.array([0.0, 0.0, row.d]))
    if modified:
        return _behind(*across, turn), shift
    return turn, _behind(*shift, across)


def _behind(rotation: np.ndarray, position: np.ndarray, more: _Displacement) -> _Displacement:
    return rotation @ more[0], position + rotation @ more[1]
