"""A Denavit-Hartenberg table, checked cell by cell, as the contents of a robot file.

The table has one row for each joint, and all joints are revolute::

    joint, theta_offset_deg, d_m,    a_m,     alpha_deg
    1,     0,                0.1625, 0,       90
    2,     0,                0,      -0.425,  0

begins a UR5e in the standard notation. The unit of a column ends its name, is in brackets
behind it (``[mm]``), or is in a row of units under the header; otherwise an option must
state it. ``joint`` and a ``type`` of R may be omitted.

A row of the standard notation [1] is ``Rz(theta) Tz(d) Tx(a) Rx(alpha)``. A row of Craig's
modified notation [2] is ``Rx(alpha) Tx(a) Rz(theta) Tz(d)``, with the alpha and a of its
own row, which Craig calls alpha and a of i - 1. The frame of a joint may lie anywhere along
its axis. If two axes are nearly parallel, a calibrated table has lengths d of hundreds of
metres that cancel [3]; the chain has shorter lengths.

The ROS drivers of Universal Robots write a calibrated arm as ``kinematics`` instead: before
each joint, which turns about z, a fixed transform ``{x, y, z, roll, pitch, yaw}`` (m, rad),
as the ``origin`` of a URDF, from the base frame of the controller.

[1] Denavit, J. and Hartenberg, R. S., A kinematic notation for lower-pair mechanisms based
    on matrices, Journal of Applied Mechanics 22, 1955.
[2] Craig, J. J., Introduction to Robotics: Mechanics and Control, Addison-Wesley, 1986.
[3] Hayati, S., Robot arm geometric link parameter estimation, 22nd IEEE Conference on
    Decision and Control, 1983.
"""

import math
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from elastocal.campaigns.tables import Cells, Dialect, TextTable, read_text_table
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.exchange.column_names import (
    ANGLE,
    LENGTH,
    UNITS,
    choose_unit,
    read_units,
    split_unit,
)
from elastocal.exchange.robot_text import (
    LARGEST_TURNS,
    ImportedRobot,
    check_imported,
    format_displacement,
    format_point_name,
    format_tokens,
    make_elementary_transform,
    make_origin_transform,
)
from elastocal.io.documents import check_document, read_document

_KINDS = {"theta_offset": ANGLE, "d": LENGTH, "a": LENGTH, "alpha": ANGLE}
_NEEDED = ("d", "a", "alpha")
_WITHOUT_UNIT = ("joint", "type")
_USUAL = ("joint", "theta_offset_deg", "d_m", "a_m", "alpha_deg", "type")
# Upper bound on the rows of a table; the chain of more does not fit into a robot file.
_MOST_ROWS = 500
# Upper bound on the turns of an angle in radians. A larger one, such as 90, is in degrees.
_LARGEST_TURNS_OF_RADIANS = 2
# Joint frames are moved along their axes if this makes the sum of all lengths smaller than
# this share: nearly parallel axes of calibrated tables have lengths of hundreds of metres
# that cancel.
_MUCH_SHORTER = 0.5
_SHIFT = re.compile(r"T[xyz]\((-?[0-9.]+)\)", re.ASCII)
_KINEMATICS = "kinematics"
# Keys of a transform in a kinematics file.
_KEYS = ("x", "y", "z", "roll", "pitch", "yaw")
# Joints before the links of Universal Robots, by the name of the link. In the files of
# other robots, joints and links have one name.
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
    """How a table is read.

    Attributes
    ----------
    angles, lengths : units of columns that state none.
    decimal : decimal mark, if it cannot be recognized.
    ignore : headers of columns that are left out.
    """

    angles: str | None = None
    lengths: str | None = None
    decimal: str | None = None
    ignore: Collection[str] = ()


_AS_STATED = DhOptions()


@dataclass(frozen=True)
class _DhTable:
    """A checked table.

    Attributes
    ----------
    joint_names : names of the joints, empty if the table has none.
    rows : theta, d, a and alpha of each joint, (n, 4), rad and m.
    notes : how the columns were understood.
    """

    joint_names: list[str]
    rows: np.ndarray
    notes: list[str]


def robot_from_dh(
    path: str | Path,
    options: DhOptions = _AS_STATED,
    *,
    modified: bool = False,
    name: str | None = None,
) -> ImportedRobot:
    """Import the robot of a Denavit-Hartenberg table, or of the kinematics file of a ROS
    driver.

    Parameters
    ----------
    path : the table, .csv, or the kinematics file, .yaml
    options : how the table is read
    modified : whether the table has Craig's modified notation
    name : name of the robot, by default that of the file

    Raises
    ------
    InputError
        Something cannot be read: the error has its file, line and column. Or nothing
        states the unit of a column.
    """
    source = Path(path).as_posix()
    name = name or Path(path).stem
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        for option, is_given in (
            ("--modified", modified),
            ("--ignore", options.ignore),
        ):
            if is_given:
                raise InputError(
                    option,
                    "",
                    f"a file of {_KINEMATICS}, which is no table",
                    f"the file without {option}",
                )
        return _robot_from_kinematics(path, name)
    table = _read_table(path, options)
    document: dict[str, Any] = {"name": name}
    names = table.joint_names
    # Numbers only count the joints; they do not name them.
    if not all(joint_name.isdecimal() for joint_name in names) and any(names):
        for joint_name in names:
            if not joint_name or names.count(joint_name) > 1:
                raise InputError(
                    source,
                    "column joint",
                    repr(joint_name),
                    "a name for every joint, each once",
                )
        document["joint_names"] = names
    tokens = _format_rows(table.rows, modified=modified)
    short_tokens = _format_short_chain(table.rows, modified=modified)
    length = _sum_lengths(tokens)
    short_length = _sum_lengths(short_tokens)
    notes = [*table.notes, *_LACKS]
    if short_length < _MUCH_SHORTER * length:
        tokens = short_tokens
        notes.append(
            f"lengths of {length:.4g} m that cancel along nearly parallel axes became"
            f" {short_length:.4g} m in the chain, whose joints are at other places of"
            " the same axes: the pose at the end is the same"
        )
    document["chain"] = " ".join([*tokens, "[flange]"])
    notation = "modified" if modified else "standard"
    description = f"{notation} Denavit-Hartenberg parameters"
    return check_imported(document, path, description, notes)


def _sum_lengths(tokens: list[str]) -> float:
    """Sum the lengths of the shifts in a chain, m."""
    shifts = (_SHIFT.fullmatch(token) for token in tokens)
    return sum(abs(float(shift[1])) for shift in shifts if shift)


def _read_table(path: str | Path, options: DhOptions) -> _DhTable:
    """Read a table and check it cell by cell."""
    source = Path(path).as_posix()
    suffix = Path(path).suffix
    if suffix.lower() != ".csv":
        raise InputError(
            source,
            "",
            f"a file that ends in {suffix!r}",
            f".csv, or .yaml with {_KINEMATICS}",
        )
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
        raise InputError(
            source,
            "",
            format_count(len(text.lines), "row"),
            f"at most {_MOST_ROWS}, one for each joint",
        )
    scales = {name: UNITS[_KINDS[name]][unit] for name, unit in units.items()}
    cells = text.cells(headers, scales)
    if "type" in headers:
        is_revolute = [
            joint_type.upper()[:1] in ("R", "") for joint_type in cells.texts("type")
        ]
        allowed = "R (revolute); shifts and fixed parts are written into the robot file"
        cells.refuse(~np.array(is_revolute), ["type"], allowed)
    rows = np.zeros((len(text.lines), len(_KINDS)))
    for column, name in enumerate(_KINDS):
        if name in headers:
            rows[:, column] = cells.numbers(name)
            if _KINDS[name] == ANGLE:
                _check_angles(cells, name, rows[:, column], units[name])
    joint_names = cells.texts("joint") if "joint" in headers else []
    return _DhTable(joint_names, rows, _describe(text, headers, units, options))


def _find_columns(
    text: TextTable, options: DhOptions
) -> tuple[dict[str, str], dict[str, str]]:
    """Find the headers and the units of the columns, by name."""
    headers: dict[str, str] = {}
    units: dict[str, str] = {}
    for header in text.columns:
        name, stated = (header, None) if header in _WITHOUT_UNIT else split_unit(header)
        if name not in (*_KINDS, *_WITHOUT_UNIT):
            suggestion = suggest_names(header, _USUAL)
            raise InputError(
                text.path,
                "header",
                repr(header),
                f"{suggestion}; import dh --ignore {header!r} leaves it out",
            )
        if name in headers:
            raise InputError(text.path, "header", f"{name} twice", "each column once")
        headers[name] = header
        if name in _KINDS:
            unit = choose_unit(text, header, stated)
            units[name] = _check_unit(text, header, _KINDS[name], unit, options)
    for name in _NEEDED:
        if name not in headers:
            raise InputError(
                text.path,
                "header",
                f"no column {name}",
                "theta_offset, d, a and alpha, such as d_m or d_mm",
            )
    return headers, units


def _check_unit(
    text: TextTable, header: str, kind: str, unit: str | None, options: DhOptions
) -> str:
    """Take the unit of a column from the table, or else from an option; refuse one of
    another kind."""
    unit = unit or (options.angles if kind == ANGLE else options.lengths)
    if unit in UNITS[kind]:
        return unit
    problem = f"{header!r} in {unit}" if unit else f"no unit of {header!r}"
    option = "--angles deg" if kind == ANGLE else "--lengths mm"
    raise InputError(
        text.path,
        "header",
        problem,
        f"{option} or such, or {', '.join(UNITS[kind])} behind the name",
    )


def _check_angles(cells: Cells, name: str, values: np.ndarray, unit: str) -> None:
    """Refuse angles, rad, of more turns than a joint makes."""
    turns = LARGEST_TURNS
    advice = ""
    if unit == "rad":
        turns = _LARGEST_TURNS_OF_RADIANS
        advice = "; degrees are --angles deg"
    is_wrong = np.abs(values) > 2.0 * math.pi * turns
    cells.refuse(is_wrong, [name], f"a number, {turns} turns at most{advice}")


def _describe(
    text: TextTable, headers: dict[str, str], units: dict[str, str], options: DhOptions
) -> list[str]:
    """Describe how the columns and the file were understood."""
    columns = []
    for name, header in headers.items():
        unit = f" in {units[name]}" if name in units else ""
        columns.append(f"{header!r} as {name}{unit}")
    dialect = text.dialect
    notes = [
        f"read: {'; '.join(columns)}",
        f"file: names of columns in line {dialect.header},"
        f" separator {dialect.separator}, decimal {dialect.decimal},"
        f" encoding {dialect.encoding}",
    ]
    if options.ignore:
        notes.append(f"not used: {', '.join(options.ignore)}")
    return notes


# Elementary transforms as names with amounts, m and rad.
_Transforms = list[tuple[str, float]]


def _split_rows(
    rows: np.ndarray, *, modified: bool
) -> Iterator[tuple[_Transforms, _Transforms]]:
    """Split each row into the transforms before and behind the motion of its joint."""
    for theta, d, a, alpha in rows.tolist():
        across = [("Tx", a), ("Rx", alpha)]
        if modified:
            yield [*across, ("Rz", theta)], [("Tz", d)]
        else:
            yield [("Rz", theta)], [("Tz", d), *across]


def _format_rows(rows: np.ndarray, *, modified: bool) -> list[str]:
    """Format a table in the chain notation, row by row."""
    tokens: list[str] = []
    split_rows = _split_rows(rows, modified=modified)
    for joint, (before, behind) in enumerate(split_rows, 1):
        tokens += format_tokens(before)
        tokens.append(f"Rz(q{joint})")
        tokens += format_tokens(behind)
    return tokens


def _format_short_chain(rows: np.ndarray, *, modified: bool) -> list[str]:
    """Format a table in the chain notation, with each joint frame at the point of its axis
    that is closest to the joint frame before."""
    # Fixed transforms before, between and behind the joints, which turn about z.
    fixed = [np.eye(4)]
    for before, behind in _split_rows(rows, modified=modified):
        fixed[-1] = fixed[-1] @ _multiply(before)
        fixed.append(_multiply(behind))
    tokens: list[str] = []
    slide = 0.0
    for joint, transform in enumerate(fixed[:-1], 1):
        transform = make_elementary_transform("T", 2, -slide) @ transform
        # Take the point of the next axis that is closest to the current origin.
        slide = -float(transform[:3, 2] @ transform[:3, 3])
        transform = transform @ make_elementary_transform("T", 2, slide)
        tokens += [*format_displacement(transform), f"Rz(q{joint})"]
    last = make_elementary_transform("T", 2, -slide) @ fixed[-1]
    return [*tokens, *format_displacement(last)]


def _multiply(transforms: _Transforms) -> np.ndarray:
    """Multiply elementary transforms, ndarray (4, 4)."""
    return reduce(
        np.matmul,
        [
            make_elementary_transform(name[0], "xyz".index(name[1]), amount)
            for name, amount in transforms
        ],
    )


def _robot_from_kinematics(path: str | Path, name: str) -> ImportedRobot:
    """Import the robot of a kinematics file, its links in the order of the arm."""
    source = Path(path).as_posix()
    document = read_document(path)
    check_document(document, "ros_kinematics", source)
    entries = document[_KINEMATICS]
    has_digest = entries.pop("hash", None) is not None
    tokens: list[str] = []
    joint_names = []
    understood = []
    links = _order_links(list(entries), source)
    for joint, link in enumerate(links, 1):
        origin = [float(entries[link][key]) for key in _KEYS]
        tokens += format_displacement(make_origin_transform(origin[:3], origin[3:]))
        tokens.append(f"Rz(q{joint})")
        joint_name = _JOINTS.get(link, link)
        joint_names.append(joint_name)
        understood.append(f"q{joint} is {joint_name} of {link!r}")
    robot_document = {
        "name": name,
        "joint_names": joint_names,
        "chain": " ".join([*tokens, f"[{format_point_name(links[-1])}]"]),
    }
    notes = [f"read: {', '.join(understood)}"]
    if has_digest:
        notes.append("not used: hash")
    notes += _LACKS
    notes.append(
        "base axes are the controller's (base, not base_link, which is turned half round)"
    )
    description = "the kinematics of a calibrated robot as ROS has them"
    return check_imported(robot_document, path, description, notes)


def _order_links(links: list[str], source: str) -> list[str]:
    """Put the links of Universal Robots into the order of the arm; those of other robots
    are in this order in the file."""
    if not links:
        raise InputError(source, _KINEMATICS, "no link", "the links of the arm")
    if not set(links) <= set(_JOINTS):
        return links
    arm = list(_JOINTS)[: len(links)]
    missing = next((link for link in arm if link not in links), None)
    if missing is not None:
        allowed = f"{', '.join(_JOINTS)}, without a gap"
        raise InputError(source, _KINEMATICS, f"no link {missing}", allowed)
    return arm
