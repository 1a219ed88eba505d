"""A Denavit-Hartenberg table, checked cell by cell, to the contents of a robot file.

One row for each joint, or for what is fixed before, between or behind joints::

    joint, theta_offset_deg, d_m,    a_m,     alpha_deg, type
    1,     0,                0.1625, 0,       90,        R
    2,     0,                0,      -0.425,  0,         R

begins a UR5e in the standard notation. ``type`` is R (revolute, also where the column is left out), P (prismatic) or F (fixed).
A column of angles or lengths ends in ``_deg``, ``_rad``, ``_m`` or ``_mm``, has ``[mm]`` behind its name or a row of units
under the header; without, an option says which. In radians ``pi/2`` may stand for a number. Optional columns: ``lower`` and
``upper`` (joint limits; of prismatic joints lengths), ``compliance_urad_per_Nm``, ``mass_kg`` with ``cx``, ``cy``, ``cz``
(centre of mass in the frame of the row), and ``point`` (name of a measuring point at the frame of the row).

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
from elastocal.exchange import DH_MASS_STD
from elastocal.exchange.column_names import read_units, split_unit
from elastocal.exchange.csv_dialect import Dialect, read_text_table
from elastocal.exchange.fixed_transforms import displacement_words, elementary, origin_transform, word
from elastocal.exchange.robot_text import MOST_TURNS, Imported, check_imported, mass_entries, point_name
from elastocal.io.documents import read_document
from elastocal.io.texts import A_NUMBER, LARGEST_NUMBER, plain_number
from elastocal.mechanics.robot import UNLIMITED_DEG

_ANGLE_UNITS = {"deg": math.radians(1.0), "rad": 1.0}
_LENGTH_UNITS = {"m": 1.0, "mm": 1e-3}
_ANGLES, _LENGTHS, _LIMITS = ("theta_offset", "alpha"), ("d", "a", "cx", "cy", "cz"), ("lower", "upper")
_PLAIN, _WORDS = ("compliance_urad_per_Nm", "mass_kg"), ("joint", "type", "point")
_NEEDED = ("d", "a", "alpha")
_USUAL = ("joint", "theta_offset_deg", "d_m", "a_m", "alpha_deg", "type", "lower_deg", "upper_deg", *_PLAIN,
          "cx_m", "cy_m", "cz_m", "point")  # fmt: skip
# By which the unit is stated of what turns, and of what does not.
_OPTIONS = {True: "--angles deg or rad", False: "--lengths m or mm"}
_PI = re.compile(r"([+-]?)(\d+(?:\.\d+)?)?\*?pi(?:/(\d+(?:\.\d+)?))?", re.ASCII | re.IGNORECASE)
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
    """One row, in SI units.

    `where`: line or row of the file, for messages. `joint`: as the table calls it; empty where it does not. `kind`: one of "R",
    "P", "F". `theta`, `d`, `a`, `alpha`: rad and m; theta of a revolute joint is the offset that is added to its angle, d of a
    prismatic one to its shift. `limits`: rad, of a prismatic joint m. `compliance`: µrad/(N m), of a prismatic joint µm/N.
    `centre_m`: in the frame of the row. `point`: measuring point at the frame of the row; empty for none.
    """

    where: str
    joint: str
    kind: str
    theta: float
    d: float
    a: float
    alpha: float
    limits: tuple[float, float] | None
    compliance: float | None
    mass_kg: float | None
    centre_m: tuple[float, float, float]
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
    path: str | Path,
    modified: bool = False,
    options: DhOptions = _AS_STATED,
    name: str | None = None,
    relative_std: float = DH_MASS_STD,
) -> Imported:
    """The robot of a Denavit-Hartenberg table, or of a YAML file with the kinematics of a ROS driver.

    `modified`: Craig's notation; else the standard one. `name`: of the robot; that of the file without. `relative_std`: how
    well masses are known. Raises `InputError`: as in `read_dh_table`; compliances of some joints only, a prismatic joint
    without limits, two points of one name.
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
    words, slid = _words(rows, points, modified), np.zeros(len(joints) + 1)
    near, slides = _slid_words(_gaps(rows, points, modified), [row.kind for row in joints])
    written, short = (sum(abs(float(match[1])) for each in both if (match := _SHIFT.fullmatch(each))) for both in (words, near))
    if short < _MUCH_SHORTER * written:
        words, slid = near, slides
    document["chain"] = " ".join(words)
    if any(row.limits or row.kind == "P" for row in joints):
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


def read_dh_table(path: str | Path, options: DhOptions = _AS_STATED) -> tuple[list[DhRow], list[str]]:
    """Rows of a Denavit-Hartenberg table, and notes how they were understood and what was left out.

    Raises `InputError`: file, line and column of what cannot be read, or a
    column whose unit nothing states.
    """
    source = Path(path).as_posix()
    if Path(path).suffix.lower() != ".csv":
        raise InputError(source, "", f"a file that ends in {Path(path).suffix!r}", f".csv, or .yaml with {_KINEMATICS}")
    wanted = "columns d, a and alpha, such as d_m or d_mm"
    text = read_text_table(
        path,
        lambda cells: any(split_unit(cell)[0] in _NEEDED for cell in cells),
        Dialect(decimal=options.decimal),
        options.ignore,
        wanted,
        read_units,
        is_small=lambda name: split_unit(name)[0] in ("theta", "theta_offset", "alpha"),
    )
    dialect = text.dialect
    meanings: dict[str, _Meaning] = {}
    for column in text.columns:
        meaning = _find_meaning(column, text.units.get(column, ""), options, source)
        if any(meaning.name == other.name for other in meanings.values()):
            raise InputError(source, "header", f"{meaning.name} twice", "each column once")
        meanings[column] = meaning
    for name in _NEEDED:
        if not any(meaning.name == name for meaning in meanings.values()):
            raise InputError(source, "header", f"no column {name}", "theta_offset, d, a and alpha, such as d_m or d_mm")
    if len(text.lines) > _MOST_ROWS:
        raise InputError(source, "", counted(len(text.lines), "row"), f"at most {_MOST_ROWS}, one for each joint")
    names = [meaning.name for meaning in meanings.values()]
    cells = zip(*text.columns.values(), strict=True)
    rows = [
        _row(f"line {line}", dict(zip(names, row, strict=True)), meanings, source)
        for line, row in zip(text.lines, cells, strict=True)
    ]
    if not any(row.kind != "F" for row in rows):
        raise InputError(source, "", "no joint", "a row of type R or P for each joint")
    return rows, [
        f"read: {'; '.join(f'{name!r} as {meaning}' for name, meaning in meanings.items())}",
        f"file: names of columns in line {dialect.header}, separator {dialect.separator}, decimal {dialect.decimal}, "
        f"encoding {dialect.encoding}",
        *([f"not used: {', '.join(options.ignore)}"] if options.ignore else []),
        *text.left_out,
    ]


@dataclass(frozen=True)
class _Meaning:
    """What a column holds: its name without the unit, and the units that its angles and its lengths have, if any."""

    name: str
    angle: str = ""
    length: str = ""

    def __str__(self) -> str:
        units = " or ".join(unit for unit in (self.angle, self.length) if unit)
        return f"{self.name} in {units}" if units else self.name


def _find_meaning(column: str, below: str, options: DhOptions, source: str) -> _Meaning:
    """What a column is, by its name and the unit of the row under it."""
    if column in (*_PLAIN, *_WORDS):
        return _Meaning(column)
    name, stated = split_unit(column)
    stated, beneath = ("deg" if unit == "°" else unit or "" for unit in (stated, below))
    unit = stated or beneath
    if stated and beneath and stated != beneath:
        raise InputError(source, "header", f"{column!r} and {below!r} in the row under it", "one unit")
    turns, shifts = name in (*_ANGLES, *_LIMITS), name in (*_LENGTHS, *_LIMITS)
    if not (turns or shifts):
        allowed = f"{closest_first(column, _USUAL)}; import dh --ignore {column!r} leaves it out"
        raise InputError(source, "header", repr(column), allowed)
    units = [*(_ANGLE_UNITS if turns else ()), *(_LENGTH_UNITS if shifts else ())]
    if unit and unit not in units:
        raise InputError(source, "header", f"{column!r} in {unit}", ", ".join(units))
    angle = unit if unit in _ANGLE_UNITS else options.angles
    length = unit if unit in _LENGTH_UNITS else options.lengths
    meaning = _Meaning(name, (turns and angle) or "", (shifts and length) or "")
    if not (meaning.angle or meaning.length):
        allowed = f"{_OPTIONS[turns]}, or {name}_{'deg' if turns else 'mm'} and such"
        raise InputError(source, "header", f"no unit of {column!r}", allowed)
    return meaning


def _row(where: str, text: Mapping[str, str], meanings: Mapping[str, _Meaning], source: str) -> DhRow:
    """The row of the cells of a line, which have the names of their meanings."""
    column_of = {meaning.name: column for column, meaning in meanings.items()}
    kind = (text.get("type") or "R").upper()[:1]
    if kind not in "RPF":
        raise InputError(source, f"{where}, type", repr(text["type"]), "R (revolute), P (prismatic) or F (fixed)")

    def number(name: str) -> float | None:
        """In SI units; None where nothing stands."""
        if not text.get(name):
            return None
        column, meaning = column_of[name], meanings[column_of[name]]
        turns = name in _ANGLES or (name in _LIMITS and kind != "P")
        if name not in _PLAIN and not (meaning.angle if turns else meaning.length):
            raise InputError(source, f"{where}, {column}", "a limit without a unit", _OPTIONS[turns])
        rad = meaning.angle == "rad"
        value = _number(text[name], turns and rad)
        most = 2 if rad and name in _ANGLES else MOST_TURNS  # 90 is in degrees, whatever is stated.
        if value is None or abs(value) > (most * (2.0 * math.pi if rad else 360.0) if turns else LARGEST_NUMBER):
            allowed = f"a number, {most} turns at most{'; degrees are --angles deg' * (most == 2)}" if turns else A_NUMBER
            raise InputError(source, f"{where}, {column}", repr(text[name]), allowed)
        if name in _PLAIN:
            if not value > 0:
                raise InputError(source, f"{where}, {column}", text[name], "more than 0")
            return value
        return value * (_ANGLE_UNITS[meaning.angle] if turns else _LENGTH_UNITS[meaning.length])

    for name in _NEEDED:
        if not text[name]:
            raise InputError(source, f"{where}, {column_of[name]}", "nothing", "a number")
    low, high = number("lower"), number("upper")
    if (low is None) != (high is None) or (low is not None and high is not None and low >= high):
        found = " to ".join(text.get(name) or "nothing" for name in _LIMITS)
        raise InputError(source, f"{where}, lower and upper", found, "both limits, the lower one first, or none")
    mass, centre = number("mass_kg"), [number(name) for name in ("cx", "cy", "cz")]
    if mass is None and any(part is not None for part in centre):
        raise InputError(source, f"{where}, mass_kg", "nothing, but a centre", "the mass in kg")
    if mass is not None and None in centre:
        raise InputError(source, f"{where}, cx, cy, cz", "no centre of the mass", "three numbers, in the frame of the row")
    x, y, z = (part or 0.0 for part in centre)
    theta, d, a, alpha = (number(name) or 0.0 for name in ("theta_offset", "d", "a", "alpha"))
    joint, point, compliance = text.get("joint", ""), text.get("point", ""), number("compliance_urad_per_Nm")
    stated = None if low is None or high is None else (low, high)
    return DhRow(where, joint, kind, theta, d, a, alpha, stated, compliance, mass, (x, y, z), point)


def _number(text: str, of_pi: bool) -> float | None:
    """A number, or in radians a multiple of pi; None for anything else."""
    match = _PI.fullmatch(text.replace(" ", "")) if of_pi else None
    if not match:
        return plain_number(text)
    sign, *parts = match.groups()
    factor, divisor = (plain_number(part or "1") for part in parts)
    return (-1.0 if sign == "-" else 1.0) * factor * math.pi / divisor if factor is not None and divisor else None


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


def _masses(rows: Sequence[DhRow], modified: bool, relative_std: float, slid: np.ndarray) -> list[dict[str, Any]]:
    """Masses of each link, that of fixed rows with the joint before; centres in the frame directly behind the joint.

    `slid` (n + 1,) is by how much the frame of each link is moved along z from where the table has it (m).
    """
    body, here = 0, np.eye(4)
    moments: dict[int, np.ndarray] = {}
    for row in rows:
        before, behind = row.displacements(modified)
        if row.kind == "F":
            here = here @ before
        else:
            body, here = body + 1, elementary("T", 2, -slid[body + 1])
        here = here @ behind
        if row.mass_kg is not None:
            moments[body] = moments.get(body, np.zeros(4)) + row.mass_kg * here @ np.append(row.centre_m, 1.0)
    return mass_entries(moments, relative_std)


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
            here, last = here @ piece, place == len(gap) - 1
            if last and number < len(kinds):
                # Of the points of the next axis the nearest one.
                slides[number + 1] = -here[:3, 2] @ here[:3, 3]
                here = here @ elementary("T", 2, slides[number + 1])
            if point or last:
                words += [*displacement_words(here), *([f"[{point}]"] if point else [])]
                here = np.eye(4)
        if number < len(kinds):
            words.append(f"{'T' if kinds[number] == 'P' else 'R'}z(q{number + 1})")
    return words, slides


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
