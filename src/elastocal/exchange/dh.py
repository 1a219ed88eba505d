"""A Denavit-Hartenberg table, checked cell by cell, to the contents of a robot file.

One row for each joint, or for what is fixed before, between or behind joints::

    joint, theta_offset_deg, d_m,    a_m,     alpha_deg, type
    1,     0,                0.1625, 0,       90,        R
    2,     0,                0,      -0.425,  0,         R

begins a UR5e in the standard notation. ``type`` is R (revolute, also where the column is left out), P (prismatic) or F (fixed).
A column of angles or lengths ends in ``_deg``, ``_rad``, ``_m`` or ``_mm``, has ``[mm]`` behind its name or a row of units
under the header; without, an option says which. Optional columns: ``lower`` and ``upper`` (joint limits; of prismatic joints
lengths), and ``point`` (name of a measuring point at the frame of the row).

A row of the standard notation [1] is ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, one of Craig's modified notation [2]
``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` with the alpha and a of its own row, which he calls alpha and a of i - 1. A joint's angle is
added to theta, a prismatic joint's shift to d.

Joint frames may be moved along their own axes, which changes no pose behind them: a turn about z and a shift along z commute,
``Tz(s) Rz(q) Tz(-s) = Rz(q)``, and so for ``Tz(q)``. Where two axes are nearly parallel, their common normal is anywhere along
them, and a calibrated table has lengths d of hundreds of metres that cancel [3]; the frames of a chain need not be there.

The ROS drivers of Universal Robots write a calibrated arm as ``kinematics`` instead [4]: a fixed transform before each joint,
``{x, y, z, roll, pitch, yaw}`` (m, rad), as ``origin`` of a URDF; the joint turns about z. The base frame is that of the
controller (``base`` of ur_description, not ``base_link``).

[1] Denavit, J. and Hartenberg, R. S., A kinematic notation for lower-pair mechanisms based on matrices, Journal of Applied
    Mechanics 22, 1955.
[2] Craig, J. J., Introduction to Robotics: Mechanics and Control, Addison-Wesley, 1986.
[3] Hayati, S., Robot arm geometric link parameter estimation, 22nd IEEE Conference on Decision and Control, 1983.
[4] Universal Robots, ur_calibration: extracts the factory calibration of a robot, github.com/UniversalRobots.
"""

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.counting import counted
from elastocal.errors import InputError, closest_first
from elastocal.exchange.column_names import read_units, split_unit
from elastocal.exchange.csv_dialect import Dialect, TextTable, read_text_table
from elastocal.exchange.fixed_transforms import (
    displacement_words,
    elementary,
    origin_transform,
    word,
)
from elastocal.exchange.robot_text import MOST_TURNS, Imported, check_imported, point_name
from elastocal.io.documents import read_document
from elastocal.io.texts import A_NUMBER, LARGEST_NUMBER, plain_number
from elastocal.mechanics.robot import UNLIMITED_DEG

_SCALES = {"deg": math.radians(1.0), "rad": 1.0, "m": 1.0, "mm": 1e-3}
_ANGLE_UNITS, _LENGTH_UNITS = ("deg", "rad"), ("m", "mm")
_ANGLES, _LENGTHS, _LIMITS, _WORDS = ("theta_offset", "alpha"), ("d", "a"), ("lower", "upper"), ("joint", "type", "point")
_NEEDED = ("d", "a", "alpha")
_USUAL = ("joint", "theta_offset_deg", "d_m", "a_m", "alpha_deg", "type", "lower_deg", "upper_deg", "point")
# By which the unit is stated of what turns, and of what does not.
_OPTIONS = {True: "--angles deg or rad", False: "--lengths m or mm"}
# The chain of more has no room in a robot file.
_MOST_ROWS = 500
_DECIMALS = 9
# Calibrated tables have lengths along nearly parallel axes, by hundreds of metres, that cancel.
_MUCH_SHORTER = 0.5
_SHIFT = re.compile(r"T[xyz]\((-?[0-9.]+)\)", re.ASCII)
# Of a kinematics file: keys of a transform, and links of Universal Robots with the joints before them; of other robots both
# have the name that the file has.
_KINEMATICS, _KEYS = "kinematics", ("x", "y", "z", "roll", "pitch", "yaw")
_JOINTS = {
    "shoulder": "shoulder_pan_joint",
    "upper_arm": "shoulder_lift_joint",
    "forearm": "elbow_joint",
    **{f"wrist_{number}": f"wrist_{number}_joint" for number in (1, 2, 3)},
}
# A displacement, ndarray (4, 4), and the measuring point at its end; empty for none.
_Piece = tuple[np.ndarray, str]


@dataclass(frozen=True)
class DhRow:
    """One row, in SI units: rad and m; limits of a prismatic joint in m.

    `where`: line of the file, for messages. `joint`: as the table calls it; empty where it does not. `kind`: one of "R", "P",
    "F". `theta` of a revolute joint is the offset that is added to its angle, `d` of a prismatic one to its shift. `point`:
    measuring point at the frame of the row; empty for none.
    """

    where: str
    joint: str
    kind: str
    theta: float
    d: float
    a: float
    alpha: float
    limits: tuple[float, float] | None
    point: str

    def displacements(self, modified: bool) -> tuple[np.ndarray, np.ndarray]:
        """What stands before the row's joint, and what behind, ndarray (4, 4) each."""
        across = elementary("T", 0, self.a) @ elementary("R", 0, self.alpha)
        turn, shift = elementary("R", 2, self.theta), elementary("T", 2, self.d)
        return (across @ turn, shift) if modified else (turn, shift @ across)


@dataclass(frozen=True)
class DhOptions:
    """How a table is read.

    `angles`, `lengths`: units of columns that do not say; asked for where they are None. `decimal`: of CSV; found out where
    it is None. `ignore`: columns that are left out.
    """

    angles: str | None = None
    lengths: str | None = None
    decimal: str | None = None
    ignore: Collection[str] = ()


_AS_STATED = DhOptions()


def robot_from_dh(
    path: str | Path, modified: bool = False, options: DhOptions = _AS_STATED, name: str | None = None
) -> Imported:
    """The robot of a Denavit-Hartenberg table, or of a YAML file with the kinematics of a ROS driver.

    `modified`: Craig's notation; else the standard one. `name`: of the robot; that of the file without. Raises `InputError`: as
    in `read_dh_table`; a prismatic joint without limits, two points of one name.
    """
    source = Path(path).as_posix()
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        if option := "--modified" if modified else "--ignore" if options.ignore else "":
            raise InputError(option, "", f"a file of {_KINEMATICS}, which is no table", f"the file without {option}")
        return _robot_from_kinematics(path, name)
    rows, understood = read_dh_table(path, options)
    joints = [row for row in rows if row.kind != "F"]
    points = [point_name(row.point) if row.point else "" for row in rows]
    points[-1] = points[-1] or "flange"
    document: dict[str, Any] = {"name": name or Path(path).stem}
    names = [row.joint for row in joints]
    # Numbers alone only count the joints.
    if any(names) and not all(each.isdecimal() for each in names):
        for row in joints:
            if not row.joint or names.count(row.joint) > 1:
                raise InputError(source, f"{row.where}, joint", repr(row.joint), "a name for every joint, each once")
        document["joint_names"] = names
    words, notes = _words(rows, points, modified), ["no masses: the weight of the links is not known"]
    near = _slid_words(_gaps(rows, points, modified), [row.kind for row in joints])
    written, short = (sum(abs(float(match[1])) for each in both if (match := _SHIFT.fullmatch(each))) for both in (words, near))
    if short < _MUCH_SHORTER * written:
        words = near
        notes.append(
            f"lengths of {written:.4g} m that cancel along nearly parallel axes became {short:.4g} m in the chain, "
            "whose joints are at other places of the same axes: the pose at the end is the same"
        )
    document["chain"] = " ".join(words)
    if any(row.limits or row.kind == "P" for row in joints):
        document["joint_limits_deg"] = [_limits(row, source) for row in joints]
    if free := [str(number) for number, row in enumerate(joints, 1) if row.limits is None]:
        notes.append(f"no limits of q{', q'.join(free)}: a turn either way")
    notation = f"{'modified' if modified else 'standard'} Denavit-Hartenberg parameters"
    return check_imported(document, path, notation, [*understood, *notes])


def read_dh_table(path: str | Path, options: DhOptions = _AS_STATED) -> tuple[list[DhRow], list[str]]:
    """Rows of a Denavit-Hartenberg table, and notes how they were understood and what was left out.

    An `InputError` names file, line and column of what cannot be read, or a column whose unit nothing states.
    """
    source = Path(path).as_posix()
    if Path(path).suffix.lower() != ".csv":
        raise InputError(source, "", f"a file that ends in {Path(path).suffix!r}", f".csv, or .yaml with {_KINEMATICS}")
    text = read_text_table(
        path,
        lambda cells: any(split_unit(cell)[0] in _NEEDED for cell in cells),
        Dialect(decimal=options.decimal),
        options.ignore,
        "columns d, a and alpha, such as d_m or d_mm",
        read_units,
    )
    columns: dict[str, _Column] = {}
    for header in text.columns:
        column = _column(header, text.units.get(header, ""), options, source)
        if column.name in columns:
            raise InputError(source, "header", f"{column.name} twice", "each column once")
        columns[column.name] = column
    for name in _NEEDED:
        if name not in columns:
            raise InputError(source, "header", f"no column {name}", "theta_offset, d, a and alpha, such as d_m or d_mm")
    if len(text.lines) > _MOST_ROWS:
        raise InputError(source, "", counted(len(text.lines), "row"), f"at most {_MOST_ROWS}, one for each joint")
    rows = [_row(text, place, columns) for place in range(len(text.lines))]
    if not any(row.kind != "F" for row in rows):
        raise InputError(source, "", "no joint", "a row of type R or P for each joint")
    return rows, [
        f"read: {'; '.join(f'{column.header!r} as {column}' for column in columns.values())}",
        f"file: names of columns in line {text.dialect.header}, separator {text.dialect.separator}, "
        f"decimal {text.dialect.decimal}, encoding {text.dialect.encoding}",
        *([f"not used: {', '.join(options.ignore)}"] if options.ignore else []),
        *text.left_out,
    ]


@dataclass(frozen=True)
class _Column:
    """Header of a column, its name without the unit, and the units that its angles and its lengths have, if any."""

    header: str
    name: str
    angle: str = ""
    length: str = ""

    def __str__(self) -> str:
        units = " or ".join(unit for unit in (self.angle, self.length) if unit)
        return f"{self.name} in {units}" if units else self.name


def _column(header: str, below: str, options: DhOptions, source: str) -> _Column:
    """What a column is, by its header and the unit of the row under it."""
    if header in _WORDS:
        return _Column(header, header)
    name, stated = split_unit(header)
    stated, beneath = ("deg" if unit == "°" else unit or "" for unit in (stated, below))
    unit = stated or beneath
    if stated and beneath and stated != beneath:
        raise InputError(source, "header", f"{header!r} and {below!r} in the row under it", "one unit")
    turns, shifts = name in (*_ANGLES, *_LIMITS), name in (*_LENGTHS, *_LIMITS)
    if not (turns or shifts):
        allowed = f"{closest_first(header, _USUAL)}; import dh --ignore {header!r} leaves it out"
        raise InputError(source, "header", repr(header), allowed)
    units = [*(_ANGLE_UNITS if turns else ()), *(_LENGTH_UNITS if shifts else ())]
    if unit and unit not in units:
        raise InputError(source, "header", f"{header!r} in {unit}", ", ".join(units))
    angle = unit if unit in _ANGLE_UNITS else options.angles
    length = unit if unit in _LENGTH_UNITS else options.lengths
    column = _Column(header, name, (turns and angle) or "", (shifts and length) or "")
    if not (column.angle or column.length):
        allowed = f"{_OPTIONS[turns]}, or {name}_{'deg' if turns else 'mm'} and such"
        raise InputError(source, "header", f"no unit of {header!r}", allowed)
    return column


def _row(text: TextTable, place: int, columns: Mapping[str, _Column]) -> DhRow:
    """A row of the table, its numbers in SI units."""
    cells = {name: text.columns[column.header][place] for name, column in columns.items()}
    source, where = text.path, f"line {text.lines[place]}"
    kind = (cells.get("type") or "R").upper()[:1]
    if kind not in "RPF":
        raise InputError(source, f"{where}, type", repr(cells["type"]), "R (revolute), P (prismatic) or F (fixed)")

    def number(name: str) -> float | None:
        if not cells.get(name):
            return None
        column, turns = columns[name], name in _ANGLES or (name in _LIMITS and kind != "P")
        unit = column.angle if turns else column.length
        if not unit:
            raise InputError(source, f"{where}, {column.header}", "a limit without a unit", _OPTIONS[turns])
        value = plain_number(cells[name])
        most = 2 if unit == "rad" and name in _ANGLES else MOST_TURNS  # 90 is in degrees, whatever is stated.
        if value is None or abs(value) > (most * (2.0 * math.pi if unit == "rad" else 360.0) if turns else LARGEST_NUMBER):
            allowed = f"a number, {most} turns at most{'; degrees are --angles deg' * (most == 2)}" if turns else A_NUMBER
            raise InputError(source, f"{where}, {column.header}", repr(cells[name]), allowed)
        return value * _SCALES[unit]

    for name in _NEEDED:
        if not cells[name]:
            raise InputError(source, f"{where}, {columns[name].header}", "nothing", "a number")
    low, high = number("lower"), number("upper")
    if (low is None) != (high is None) or (low is not None and high is not None and low >= high):
        found = " to ".join(cells.get(name) or "nothing" for name in _LIMITS)
        raise InputError(source, f"{where}, lower and upper", found, "both limits, the lower one first, or none")
    theta, d, a, alpha = (number(name) or 0.0 for name in ("theta_offset", "d", "a", "alpha"))
    limits = None if low is None or high is None else (low, high)
    return DhRow(where, cells.get("joint", ""), kind, theta, d, a, alpha, limits, cells.get("point", ""))


def _words(rows: Sequence[DhRow], points: Sequence[str], modified: bool) -> list[str]:
    words: list[str] = []
    joint = 0
    for row, point in zip(rows, points, strict=True):
        across = [word("Tx", row.a), word("Rx", row.alpha)]
        along = [word("Rz", row.theta), "", "", word("Tz", row.d)]
        if row.kind != "F":
            joint += 1
            along[1 if row.kind == "R" else 2] = f"{'R' if row.kind == 'R' else 'T'}z(q{joint})"
        # Rx and Tx commute, and so do Rz and Tz: a joint stands before its own d, where the standard notation has it.
        words += [*across, *along] if modified else [*along, *across]
        words.append(f"[{point}]" if point else "")
    return [each for each in words if each]


def _limits(row: DhRow, source: str) -> list[float]:
    if row.limits is None and row.kind == "P":
        raise InputError(source, f"{row.where}, lower and upper", "nothing", "limits of a prismatic joint")
    if row.limits is None:
        return list(UNLIMITED_DEG)
    return [round(value if row.kind == "P" else math.degrees(value), _DECIMALS) for value in row.limits]


def _gaps(rows: Sequence[DhRow], points: Sequence[str], modified: bool) -> list[list[_Piece]]:
    """What stands before, between and behind the joints: displacements, each with the point at its end."""
    gaps: list[list[_Piece]] = [[]]
    for row, point in zip(rows, points, strict=True):
        before, behind = row.displacements(modified)
        if row.kind == "F":
            gaps[-1].append((before @ behind, point))
        else:
            gaps[-1].append((before, ""))
            gaps.append([(behind, point)])
    return gaps


def _slid_words(gaps: Sequence[Sequence[_Piece]], kinds: Sequence[str]) -> list[str]:
    """A chain in words whose joints lie as near as their axes allow to the joint before.

    `gaps`: displacements before, between and behind n joints, which move about or along z. `kinds` (n,): ``P`` of prismatic
    joints.
    """
    words: list[str] = []
    slide = 0.0
    for number, gap in enumerate(gaps):
        here = elementary("T", 2, -slide)
        for place, (piece, point) in enumerate(gap):
            here, last = here @ piece, place == len(gap) - 1
            if last and number < len(kinds):
                # Of the points of the next axis the nearest one.
                slide = -here[:3, 2] @ here[:3, 3]
                here = here @ elementary("T", 2, slide)
            if point or last:
                words += [*displacement_words(here), *([f"[{point}]"] if point else [])]
                here = np.eye(4)
        if number < len(kinds):
            words.append(f"{'T' if kinds[number] == 'P' else 'R'}z(q{number + 1})")
    return words


def _robot_from_kinematics(path: str | Path, name: str | None) -> Imported:
    """The robot of a kinematics file, its links in the order of the arm; other keys and what is no number are refused."""
    source, document, wanted = Path(path).as_posix(), read_document(path), f"links, each with {', '.join(_KEYS)}"
    if not isinstance(document, dict) or _KINEMATICS not in document:
        raise InputError(source, "", f"no {_KINEMATICS}", f"{_KINEMATICS} as ROS drivers write them, or a table as .csv")
    described = document[_KINEMATICS]
    if not isinstance(described, dict):
        raise InputError(source, _KINEMATICS, type(described).__name__, wanted)
    # A digest of the calibration stands beside the links.
    links = {str(link): origin for link, origin in described.items() if link != "hash"}
    if not links:
        raise InputError(source, _KINEMATICS, "no link", wanted)
    if set(links) <= {*_JOINTS}:
        links = {link: links[link] for link in _JOINTS if link in links}
        if missing := [link for link in [*_JOINTS][: [*_JOINTS].index([*links][-1])] if link not in links]:
            raise InputError(source, _KINEMATICS, f"no link {missing[0]}", f"every link before {[*links][-1]}")
    words: list[str] = []
    for number, (link, origin) in enumerate(links.items(), 1):
        where = f"{_KINEMATICS}.{link}"
        if not isinstance(origin, dict) or set(origin) != set(_KEYS):
            found = ", ".join(map(str, origin)) if isinstance(origin, dict) else type(origin).__name__
            raise InputError(source, where, found or "nothing", ", ".join(_KEYS))
        values: list[float] = []
        for key in _KEYS:
            if (value := plain_number(str(origin[key]))) is None:
                raise InputError(source, f"{where}.{key}", repr(origin[key]), A_NUMBER)
            values.append(value)
        words += [*displacement_words(origin_transform(values[:3], values[3:])), f"Rz(q{number})"]
    names = [_JOINTS.get(link, link) for link in links]
    chain = " ".join([*words, f"[{point_name([*links][-1])}]"])
    contents = {"name": name or Path(path).stem, "joint_names": names, "chain": chain}
    notes = [
        f"read: {', '.join(f'q{n} is {name} of {link!r}' for n, (name, link) in enumerate(zip(names, links, strict=True), 1))}",
        *(["not used: hash"] if "hash" in described else []),
        "no masses: the weight of the links is not known",
        "no limits of any joint: a turn either way",
        "base axes are the controller's (base, not base_link, which is turned half round)",
    ]
    return check_imported(contents, path, "the kinematics of a calibrated robot as ROS has them", notes)
