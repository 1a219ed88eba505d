"""A Denavit-Hartenberg table, checked cell by cell, to the contents of a robot file.

One row for each joint, all of which turn::

    joint, theta_offset_deg, d_m,    a_m,     alpha_deg
    1,     0,                0.1625, 0,       90
    2,     0,                0,      -0.425,  0

begins a UR5e in the standard notation. A column of angles or lengths ends in its unit,
has ``[mm]`` behind its name or a row of units under the header; without, an option says
which. ``joint`` and a ``type`` of R may be left out.

A row of the standard notation [1] is ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``, one of
Craig's modified notation [2] ``Rx(alpha) Tx(a) Rz(theta) Tz(d)`` with the alpha and a
of its own row, which he calls alpha and a of i - 1. Along its own axis a joint frame
may be anywhere. Where two axes are nearly parallel, a calibrated table has lengths d of
hundreds of metres that cancel [3]; the frames of a chain need not be there.

The ROS drivers of Universal Robots write a calibrated arm as ``kinematics`` instead:
before each joint, which turns about z, a fixed transform ``{x, y, z, roll, pitch,
yaw}`` (m, rad), as ``origin`` of a URDF, from the controller's base frame on.

[1] Denavit, J. and Hartenberg, R. S., A kinematic notation for lower-pair mechanisms based on matrices, Journal of Applied
    Mechanics 22, 1955.
[2] Craig, J. J., Introduction to Robotics: Mechanics and Control, Addison-Wesley, 1986.
[3] Hayati, S., Robot arm geometric link parameter estimation, 22nd IEEE Conference on Decision and Control, 1983.
"""

import math
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.tables import Cells, Dialect, TextTable, read_text_table
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.column_names import ANGLE, LENGTH, UNITS, read_units, split_unit
from elastocal.exchange.robot_text import (
    MOST_TURNS,
    Imported,
    check_imported,
    displacement_words,
    elementary,
    origin_transform,
    point_name,
    word,
)
from elastocal.io.documents import read_document
from elastocal.io.texts import NUMBER_ALLOWED, parse_number

_KINDS = {"theta_offset": ANGLE, "d": LENGTH, "a": LENGTH, "alpha": ANGLE}
_NEEDED = ("d", "a", "alpha")
_WORDS = ("joint", "type")
_USUAL = ("joint", "theta_offset_deg", "d_m", "a_m", "alpha_deg", "type")
# The chain of more has no room in a robot file.
_MOST_ROWS = 500
# Calibrated tables have lengths along nearly parallel axes, by hundreds of metres, that
# cancel.
_MUCH_SHORTER = 0.5
_SHIFT = re.compile(r"T[xyz]\((-?[0-9.]+)\)", re.ASCII)
# Of a kinematics file: keys of a transform, and links of Universal Robots with the
# joints before them; of other robots both have the name that the file has.
_KINEMATICS = "kinematics"
_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
_JOINTS = {
    "shoulder": "shoulder_pan_joint",
    "upper_arm": "shoulder_lift_joint",
    "forearm": "elbow_joint",
    **{f"wrist_{number}": f"wrist_{number}_joint" for number in (1, 2, 3)},
}
_LACKS = [
    "no masses: the weight of the links is not known",
    "no limits of any joint: a turn either way",
]


@dataclass(frozen=True)
class DhOptions:
    """Units of columns that do not say, the decimal mark where it is not to be found
    out, and columns to leave out."""

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
) -> Imported:
    """The robot of a Denavit-Hartenberg table, or of a YAML file with the kinematics of
    a ROS driver.

    `modified`: Craig's notation; else the standard one. `name`: of the robot; that of
    the file without. An `InputError` names file, line and column of what cannot be
    read, or a column whose unit nothing states.
    """
    source = Path(path).as_posix()
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        for option, is_given in (
            ("--modified", modified),
            ("--ignore", options.ignore),
        ):
            if is_given:
                found = f"a file of {_KINEMATICS}, which is no table"
                raise InputError(option, "", found, f"the file without {option}")
        return _robot_from_kinematics(path, name)
    table = _read_table(path, options)
    document: dict[str, Any] = {"name": name or Path(path).stem}
    names = table.joint_names
    # Numbers alone only count the joints.
    if any(names) and not all(joint_name.isdecimal() for joint_name in names):
        for joint_name in names:
            if not joint_name or names.count(joint_name) > 1:
                allowed = "a name for every joint, each once"
                raise InputError(source, "column joint", repr(joint_name), allowed)
        document["joint_names"] = names
    words = _words(table.rows, modified)
    shortest_words = _slid_words(table.rows, modified)
    length = _total_shift(words)
    shortest_length = _total_shift(shortest_words)
    notes = [*table.notes, *_LACKS]
    if shortest_length < _MUCH_SHORTER * length:
        words = shortest_words
        notes.append(
            f"lengths of {length:.4g} m that cancel along nearly parallel axes became"
            f" {shortest_length:.4g} m in the chain, whose joints are at other places of"
            " the same axes: the pose at the end is the same"
        )
    document["chain"] = " ".join([*words, "[flange]"])
    return check_imported(
        document,
        path,
        f"{'modified' if modified else 'standard'} Denavit-Hartenberg parameters",
        notes,
    )


@dataclass(frozen=True)
class _DhTable:
    """The table: names of the joints, empty if there are none; `rows` (n, 4) of theta,
    d, a and alpha, rad and m; and notes how its columns were understood."""

    joint_names: list[str]
    rows: np.ndarray
    notes: list[str]


def _total_shift(words: list[str]) -> float:
    """Sum of the lengths of the shifts in a chain, m."""
    shifts = (_SHIFT.fullmatch(text) for text in words)
    return sum(abs(float(shift[1])) for shift in shifts if shift)


def _read_table(path: str | Path, options: DhOptions) -> _DhTable:
    """Read a table and check it cell by cell."""
    source = Path(path).as_posix()
    suffix = Path(path).suffix
    if suffix.lower() != ".csv":
        found = f"a file that ends in {suffix!r}"
        raise InputError(source, "", found, f".csv, or .yaml with {_KINEMATICS}")
    text = read_text_table(
        path,
        lambda cells: any(split_unit(cell)[0] in _NEEDED for cell in cells),
        Dialect(decimal=options.decimal),
        options.ignore,
        "columns d, a and alpha, such as d_m or d_mm",
        read_units,
    )
    headers, units = _find_columns(text, options)
    if len(text.lines) > _MOST_ROWS:
        found = format_count(len(text.lines), "row")
        allowed = f"at most {_MOST_ROWS}, one for each joint"
        raise InputError(source, "", found, allowed)
    scales = {name: UNITS[_KINDS[name]][unit] for name, unit in units.items()}
    cells = text.cells(headers, scales)
    if "type" in headers:
        _check_types(cells)
    rows = np.zeros((len(text.lines), len(_KINDS)))
    for column, name in enumerate(_KINDS):
        if name in headers:
            rows[:, column] = cells.numbers(name)
            _check_angles(cells, name, rows[:, column], units[name])
    joint_names = cells.texts("joint") if "joint" in headers else []
    return _DhTable(joint_names, rows, _notes_on(text, headers, units, options))


def _find_columns(
    text: TextTable, options: DhOptions
) -> tuple[dict[str, str], dict[str, str]]:
    """Find the headers and the units of the columns, by name."""
    headers: dict[str, str] = {}
    units: dict[str, str] = {}
    for header in text.columns:
        name, stated = (header, None) if header in _WORDS else split_unit(header)
        if name not in (*_KINDS, *_WORDS):
            suggestion = suggest_names(header, _USUAL)
            allowed = f"{suggestion}; import dh --ignore {header!r} leaves it out"
            raise InputError(text.path, "header", repr(header), allowed)
        if name in headers:
            raise InputError(text.path, "header", f"{name} twice", "each column once")
        headers[name] = header
        if name in _KINDS:
            below = text.units.get(header)
            units[name] = _unit(header, _KINDS[name], stated, below, options, text.path)
    for name in _NEEDED:
        if name not in headers:
            allowed = "theta_offset, d, a and alpha, such as d_m or d_mm"
            raise InputError(text.path, "header", f"no column {name}", allowed)
    return headers, units


def _check_types(cells: Cells) -> None:
    """Refuse joints that are not revolute."""
    for row, joint_type in enumerate(cells.texts("type")):
        if joint_type.upper()[:1] not in ("R", ""):
            allowed = (
                "R (revolute); what shifts or is fixed is written into the robot file"
            )
            raise cells.fault(row, "type", allowed)


def _check_angles(cells: Cells, name: str, values: np.ndarray, unit: str) -> None:
    """Refuse angles, rad, of more turns than a joint makes."""
    if _KINDS[name] != ANGLE:
        return
    # A number such as 90 is in degrees, whatever unit is stated.
    turns = 2 if unit == "rad" else MOST_TURNS
    is_wrong = np.abs(values) > 2.0 * math.pi * turns
    if is_wrong.any():
        advice = "; degrees are --angles deg" if unit == "rad" else ""
        allowed = f"a number, {turns} turns at most{advice}"
        raise cells.fault(int(np.argmax(is_wrong)), name, allowed)


def _notes_on(
    text: TextTable,
    headers: dict[str, str],
    units: dict[str, str],
    options: DhOptions,
) -> list[str]:
    """Tell how the columns and the file were understood."""
    understood = []
    for name, header in headers.items():
        unit = f" in {units[name]}" if name in units else ""
        understood.append(f"{header!r} as {name}{unit}")
    dialect = text.dialect
    notes = [
        f"read: {'; '.join(understood)}",
        f"file: names of columns in line {dialect.header},"
        f" separator {dialect.separator}, decimal {dialect.decimal},"
        f" encoding {dialect.encoding}",
    ]
    if options.ignore:
        notes.append(f"not used: {', '.join(options.ignore)}")
    return notes


def _unit(
    header: str,
    kind: str,
    stated: str | None,
    below: str | None,
    options: DhOptions,
    source: str,
) -> str:
    """Unit of a column: behind its name, in the row under it, or of an option."""
    if stated and below and stated != below:
        raise InputError(
            source,
            "header",
            f"{header!r} and {below!r} in the row under it",
            "one unit",
        )
    option, usual, given = (
        ("--angles", "deg", options.angles)
        if kind == ANGLE
        else ("--lengths", "mm", options.lengths)
    )
    unit = stated or below or given
    if unit not in UNITS[kind]:
        found = f"{header!r} in {unit}" if unit else f"no unit of {header!r}"
        raise InputError(
            source,
            "header",
            found,
            f"{option} {usual} or such, or {', '.join(UNITS[kind])} behind the name",
        )
    return unit


def _words(rows: np.ndarray, modified: bool) -> list[str]:
    """A chain in words, row by row."""
    words: list[str] = []
    for joint, (theta, d, a, alpha) in enumerate(rows.tolist(), 1):
        across = [word("Tx", a), word("Rx", alpha)]
        along = [word("Rz", theta), f"Rz(q{joint})", word("Tz", d)]
        words += [*across, *along] if modified else [*along, *across]
    return [each for each in words if each]


def _slid_words(rows: np.ndarray, modified: bool) -> list[str]:
    """A chain in words whose joints lie as near as their axes allow to the joint
    before."""
    # What stands before, between and behind the joints, which turn about z.
    gaps = [np.eye(4)]
    for theta, d, a, alpha in rows:
        across = elementary("T", 0, a) @ elementary("R", 0, alpha)
        turn = elementary("R", 2, theta)
        shift = elementary("T", 2, d)
        before, behind = (across @ turn, shift) if modified else (turn, shift @ across)
        gaps[-1] = gaps[-1] @ before
        gaps.append(behind)
    words: list[str] = []
    slide = 0.0
    for number, gap in enumerate(gaps, 1):
        here = elementary("T", 2, -slide) @ gap
        if number < len(gaps):
            # Of the points of the next axis the nearest one.
            slide = -float(here[:3, 2] @ here[:3, 3])
            here = here @ elementary("T", 2, slide)
        words += [
            *displacement_words(here),
            *([f"Rz(q{number})"] if number < len(gaps) else []),
        ]
    return words


def _robot_from_kinematics(path: str | Path, name: str | None) -> Imported:
    """Read the robot of a kinematics file, its links in the order of the arm."""
    source = Path(path).as_posix()
    links, has_digest = _read_links(path)
    words: list[str] = []
    for joint, (link, origin) in enumerate(links.items(), 1):
        values = _read_origin(origin, source, f"{_KINEMATICS}.{link}")
        words += displacement_words(origin_transform(values[:3], values[3:]))
        words.append(f"Rz(q{joint})")
    joint_names = [_JOINTS.get(link, link) for link in links]
    last_link = [*links][-1]
    chain = " ".join([*words, f"[{point_name(last_link)}]"])
    document = {
        "name": name or Path(path).stem,
        "joint_names": joint_names,
        "chain": chain,
    }
    joints = [
        f"q{joint} is {joint_name} of {link!r}"
        for joint, (joint_name, link) in enumerate(
            zip(joint_names, links, strict=True), 1
        )
    ]
    notes = [f"read: {', '.join(joints)}"]
    if has_digest:
        notes.append("not used: hash")
    notes += _LACKS
    notes.append(
        "base axes are the controller's (base, not base_link, which is turned half round)"
    )
    options = "the kinematics of a calibrated robot as ROS has them"
    return check_imported(document, path, options, notes)


def _read_links(path: str | Path) -> tuple[dict[str, Any], bool]:
    """Read the entries of the links of a kinematics file, in the order of the arm, and
    whether a digest of the calibration is among them."""
    source = Path(path).as_posix()
    document = read_document(path)
    if not isinstance(document, dict) or _KINEMATICS not in document:
        allowed = f"{_KINEMATICS} as ROS drivers write them, or a table as .csv"
        raise InputError(source, "", f"no {_KINEMATICS}", allowed)
    entries = document[_KINEMATICS]
    allowed = f"links, each with {', '.join(_KEYS)}"
    if not isinstance(entries, dict):
        raise InputError(source, _KINEMATICS, type(entries).__name__, allowed)
    links = {str(link): origin for link, origin in entries.items() if link != "hash"}
    if not links:
        raise InputError(source, _KINEMATICS, "no link", allowed)
    if set(links) <= set(_JOINTS):
        links = {link: links[link] for link in _JOINTS if link in links}
        last_link = [*links][-1]
        for link in _JOINTS:
            if link == last_link:
                break
            if link not in links:
                allowed = f"every link before {last_link}"
                raise InputError(source, _KINEMATICS, f"no link {link}", allowed)
    return links, "hash" in entries


def _read_origin(origin: object, source: str, key: str) -> list[float]:
    """Read x, y, z (m), roll, pitch and yaw (rad) of a link."""
    if not isinstance(origin, dict):
        raise InputError(source, key, type(origin).__name__, ", ".join(_KEYS))
    if set(origin) != set(_KEYS):
        found = ", ".join(map(str, origin)) or "nothing"
        raise InputError(source, key, found, ", ".join(_KEYS))
    values = []
    for name in _KEYS:
        value = parse_number(str(origin[name]))
        if value is None:
            raise InputError(
                source, f"{key}.{name}", repr(origin[name]), NUMBER_ALLOWED
            )
        values.append(value)
    return values
