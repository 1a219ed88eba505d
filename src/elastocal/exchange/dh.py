"""A Denavit-Hartenberg table, checked cell by cell, as the contents of a robot file.

The table has one row for each joint, or for a part that is fixed::

    joint, theta_offset_deg, d_m,    a_m,     alpha_deg, type
    1,     0,                0.1625, 0,       90,        R
    2,     0,                0,      -0.425,  0,         R

begins a UR5e in the standard notation. The unit of a column ends its name, is in brackets
behind it (``[mm]``), or is in a row of units under the header; otherwise an option must
state it. ``type`` is R (revolute, also where the column is omitted), P (prismatic: the
shift is added to d) or F (fixed). ``joint`` may be omitted, and so may ``lower`` and
``upper``, the limits, unless a joint is prismatic: its limits have the unit of d.

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
from collections.abc import Collection, Iterator, Mapping, Sequence
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
from elastocal.io.texts import NUMBER_ALLOWED, parse_number
from elastocal.mechanics.robot import UNLIMITED_DEG

_KINDS = {"theta_offset": ANGLE, "d": LENGTH, "a": LENGTH, "alpha": ANGLE}
_LIMITS = ("lower", "upper")
# Types of rows by the first letter.
_REVOLUTE = "R"
_PRISMATIC = "P"
_FIXED = "F"
_NEEDED = ("d", "a", "alpha")
_WITHOUT_UNIT = ("joint", "type")
_USUAL = (
    "joint",
    "theta_offset_deg",
    "d_m",
    "a_m",
    "alpha_deg",
    "type",
    "lower_deg",
    "upper_deg",
)
# Upper bound on the rows of a table; the chain of more does not fit into a robot file.
_MOST_ROWS = 500
# Decimals of limits in the robot file, deg or m.
_DECIMALS = 9
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
_NO_MASSES = "no masses: the weight of the links is not known"
_NO_LIMITS = "no limits of any joint: a turn either way"


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
    rows : theta, d, a and alpha of each row, (n, 4), rad and m.
    types : type of each row.
    limits : lower and upper limit of each joint, deg or m; empty if there are none.
    notes : how the columns were understood.
    """

    joint_names: list[str]
    rows: np.ndarray
    types: list[str]
    limits: list[list[float]]
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
    if _names_joints(table, Path(path).as_posix()):
        document["joint_names"] = table.joint_names
    if table.limits:
        document["joint_limits_deg"] = table.limits
    notes = [*table.notes, _NO_MASSES]
    if not table.limits:
        notes.append(_NO_LIMITS)
    document["chain"], chain_notes = _format_chain(table, modified=modified)
    notes += chain_notes
    notation = "modified" if modified else "standard"
    description = f"{notation} Denavit-Hartenberg parameters"
    return check_imported(document, path, description, notes)


def format_dh_chain(rows: np.ndarray, *, modified: bool = False) -> str:
    """Format the chain of Denavit-Hartenberg parameters.

    Parameters
    ----------
    rows : (n, 4) array, theta, d, a and alpha of each revolute joint, rad and m
    modified : whether they are in Craig's modified notation
    """
    table = _DhTable([], rows, [_REVOLUTE] * len(rows), [], [])
    return _format_chain(table, modified=modified)[0]


def _format_chain(table: _DhTable, *, modified: bool) -> tuple[str, list[str]]:
    """Format the chain of a table; also returns notes about its lengths."""
    rows = [*_split_rows(table, modified=modified)]
    tokens = _format_rows(rows)
    short_tokens = _format_short_chain(rows)
    length = _sum_lengths(tokens)
    short_length = _sum_lengths(short_tokens)
    notes = []
    if short_length < _MUCH_SHORTER * length:
        tokens = short_tokens
        notes.append(
            f"lengths of {length:.4g} m that cancel along nearly parallel axes became"
            f" {short_length:.4g} m in the chain, whose joints are at other places of"
            " the same axes: the pose at the end is the same"
        )
    return " ".join([*tokens, "[flange]"]), notes


def _names_joints(table: _DhTable, source: str) -> bool:
    """Whether a table has names of its joints; names that are missing or there twice are
    refused. Numbers only count the joints; they do not name them."""
    names = table.joint_names
    if all(name.isdecimal() for name in names) or not any(names):
        return False
    for name in names:
        if not name or names.count(name) > 1:
            allowed = "a name for every joint, each once"
            raise InputError(source, "column joint", repr(name), allowed)
    return True


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
    scales = {
        name: UNITS[kind][units[name]] for name, kind in _KINDS.items() if name in units
    }
    cells = text.cells(headers, scales)
    types = _read_types(cells)
    rows = np.zeros((len(text.lines), len(_KINDS)))
    for column, name in enumerate(_KINDS):
        if name in headers:
            rows[:, column] = cells.numbers(name)
            if _KINDS[name] == ANGLE:
                _check_angles(cells, name, rows[:, column], units[name])
    joint_names = cells.texts("joint") if "joint" in headers else []
    joint_names = [
        name for name, kind in zip(joint_names, types, strict=False) if kind != _FIXED
    ]
    return _DhTable(
        joint_names,
        rows,
        types,
        _read_limits(cells, types, units),
        _describe(text, headers, units, options),
    )


def _read_types(cells: Cells) -> list[str]:
    """Read the types of the rows; without a column all are revolute."""
    if "type" not in cells.columns:
        return [_REVOLUTE] * len(cells.rows)
    types = [kind.upper()[:1] or _REVOLUTE for kind in cells.texts("type")]
    is_unknown = [kind not in (_REVOLUTE, _PRISMATIC, _FIXED) for kind in types]
    allowed = "R (revolute), P (prismatic) or F (fixed)"
    cells.refuse(np.array(is_unknown), ["type"], allowed)
    return types


def _read_limits(
    cells: Cells, types: Sequence[str], units: Mapping[str, str]
) -> list[list[float]]:
    """Read the limits of the joints, deg or m; none if the table has no column of them.

    A joint without limits may make a turn either way; a prismatic one needs its own.
    """
    if "lower" not in units and _PRISMATIC not in types:
        return []
    length = UNITS[LENGTH][units["d"]]
    limits = []
    for row, kind in enumerate(types):
        if kind == _FIXED:
            continue
        texts = [_read_cell(cells, name, row) for name in _LIMITS]
        if kind == _PRISMATIC and "" in texts:
            raise cells.fault(
                row,
                "type",
                f"columns lower and upper, in {units['d']} as d, for a prismatic joint",
                "no limits of a prismatic joint",
            )
        if texts == ["", ""]:
            limits.append(list(UNLIMITED_DEG))
            continue
        scale = length
        if kind == _REVOLUTE:
            scale = math.degrees(UNITS[ANGLE][units["lower"]])
        values = []
        for name, text in zip(_LIMITS, texts, strict=True):
            value = parse_number(text)
            if value is None:
                raise cells.fault(row, name, NUMBER_ALLOWED)
            values.append(round(scale * value, _DECIMALS))
        limits.append(values)
    return limits


def _read_cell(cells: Cells, name: str, row: int) -> str:
    """Read the text of a cell, "" if the table has no such column."""
    return cells.texts(name)[row] if name in cells.columns else ""


def _find_columns(
    text: TextTable, options: DhOptions
) -> tuple[dict[str, str], dict[str, str]]:
    """Find the headers and the units of the columns, by name."""
    headers: dict[str, str] = {}
    units: dict[str, str] = {}
    for header in text.columns:
        name, stated = (header, None) if header in _WITHOUT_UNIT else split_unit(header)
        if name not in (*_KINDS, *_LIMITS, *_WITHOUT_UNIT):
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
        elif name in _LIMITS:
            unit = choose_unit(text, header, stated)
            units[name] = _check_unit(text, header, ANGLE, unit, options)
    if len({units.get(name) for name in _LIMITS}) > 1:
        finding = f"lower in {units.get('lower')} and upper in {units.get('upper')}"
        raise InputError(text.path, "header", finding, "both limits, in one unit")
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


@dataclass(frozen=True)
class _DhRow:
    """A row as transforms before and behind the motion of its joint about or along z.

    Attributes
    ----------
    before, behind : elementary transforms.
    motion : "R", "T", or "" if nothing moves.
    """

    before: _Transforms
    behind: _Transforms
    motion: str


_MOTIONS = {_REVOLUTE: "R", _PRISMATIC: "T", _FIXED: ""}


def _split_rows(table: _DhTable, *, modified: bool) -> Iterator[_DhRow]:
    """Split each row into the transforms before and behind the motion of its joint."""
    for (theta, d, a, alpha), kind in zip(
        table.rows.tolist(), table.types, strict=True
    ):
        across = [("Tx", a), ("Rx", alpha)]
        if modified:
            yield _DhRow([*across, ("Rz", theta)], [("Tz", d)], _MOTIONS[kind])
        else:
            yield _DhRow([("Rz", theta)], [("Tz", d), *across], _MOTIONS[kind])


def _format_rows(rows: Sequence[_DhRow]) -> list[str]:
    """Format a table in the chain notation, row by row."""
    tokens: list[str] = []
    joint = 0
    for row in rows:
        tokens += format_tokens(row.before)
        if row.motion:
            joint += 1
            tokens.append(f"{row.motion}z(q{joint})")
        tokens += format_tokens(row.behind)
    return tokens


def _format_short_chain(rows: Sequence[_DhRow]) -> list[str]:
    """Format a table in the chain notation, with each joint frame at the point of its axis
    that is closest to the joint frame before."""
    # Fixed transforms before, between and behind the joints, which move about or along z.
    fixed = [np.eye(4)]
    motions = []
    for row in rows:
        fixed[-1] = fixed[-1] @ _multiply(row.before)
        if row.motion:
            motions.append(row.motion)
            fixed.append(np.eye(4))
        fixed[-1] = fixed[-1] @ _multiply(row.behind)
    tokens: list[str] = []
    slide = 0.0
    for joint, motion in enumerate(motions, 1):
        transform = make_elementary_transform("T", 2, -slide) @ fixed[joint - 1]
        # Take the point of the next axis that is closest to the current origin.
        slide = -float(transform[:3, 2] @ transform[:3, 3])
        transform = transform @ make_elementary_transform("T", 2, slide)
        tokens += [*format_displacement(transform), f"{motion}z(q{joint})"]
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
    notes += [_NO_MASSES, _NO_LIMITS]
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
