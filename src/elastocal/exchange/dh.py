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

from elastocal.campaigns.tables import Dialect, read_text_table
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
        if option := "--modified" if modified else "--ignore" if options.ignore else "":
            raise InputError(
                option,
                "",
                f"a file of {_KINEMATICS}, which is no table",
                f"the file without {option}",
            )
        return _robot_from_kinematics(path, name)
    names, rows, notes = _read_table(path, options)
    document: dict[str, Any] = {"name": name or Path(path).stem}
    # Numbers alone only count the joints.
    if any(names) and not all(each.isdecimal() for each in names):
        if wrong := [each for each in names if not each or names.count(each) > 1]:
            raise InputError(
                source,
                "column joint",
                repr(wrong[0]),
                "a name for every joint, each once",
            )
        document["joint_names"] = names
    words = _words(rows, modified)
    near = _slid_words(rows, modified)
    written, short = (
        sum(abs(float(match[1])) for each in both if (match := _SHIFT.fullmatch(each)))
        for both in (words, near)
    )
    notes += _LACKS
    if short < _MUCH_SHORTER * written:
        words = near
        notes.append(
            f"lengths of {written:.4g} m that cancel along nearly parallel axes became {short:.4g} m in the chain, "
            "whose joints are at other places of the same axes: the pose at the end is the same"
        )
    document["chain"] = " ".join([*words, "[flange]"])
    return check_imported(
        document,
        path,
        f"{'modified' if modified else 'standard'} Denavit-Hartenberg parameters",
        notes,
    )


def _read_table(
    path: str | Path, options: DhOptions
) -> tuple[list[str], np.ndarray, list[str]]:
    """Names of joints, rows (n, 4) of theta, d, a, alpha in rad and m, and notes how
    they were understood."""
    source = Path(path).as_posix()
    if Path(path).suffix.lower() != ".csv":
        raise InputError(
            source,
            "",
            f"a file that ends in {Path(path).suffix!r}",
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
    headers: dict[str, str] = {}
    units: dict[str, str] = {}
    for header in text.columns:
        name, stated = (header, None) if header in _WORDS else split_unit(header)
        if name not in (*_KINDS, *_WORDS):
            allowed = f"{suggest_names(header, _USUAL)}; import dh --ignore {header!r} leaves it out"
            raise InputError(source, "header", repr(header), allowed)
        if name in headers:
            raise InputError(source, "header", f"{name} twice", "each column once")
        headers[name] = header
        if name in _KINDS:
            units[name] = _unit(
                header, _KINDS[name], stated, text.units.get(header), options, source
            )
    if missing := [name for name in _NEEDED if name not in headers]:
        raise InputError(
            source,
            "header",
            f"no column {missing[0]}",
            "theta_offset, d, a and alpha, such as d_m or d_mm",
        )
    if len(text.lines) > _MOST_ROWS:
        raise InputError(
            source,
            "",
            format_count(len(text.lines), "row"),
            f"at most {_MOST_ROWS}, one for each joint",
        )
    read = text.cells(
        headers, {name: UNITS[_KINDS[name]][unit] for name, unit in units.items()}
    )
    for place, kind in enumerate(read.texts("type") if "type" in headers else ()):
        if kind.upper()[:1] not in ("R", ""):
            raise read.fault(
                place,
                "type",
                "R (revolute); what shifts or is fixed is written into the robot file",
            )
    rows = np.column_stack(
        [
            read.numbers(name) if name in headers else np.zeros(len(text.lines))
            for name in _KINDS
        ]
    )
    for column, name in enumerate(_KINDS):
        # 90 is in degrees, whatever is stated.
        most = 2 if units.get(name) == "rad" else MOST_TURNS
        wrong = np.abs(rows[:, column]) > 2.0 * math.pi * most
        if _KINDS[name] == ANGLE and wrong.any():
            allowed = f"a number, {most} turns at most{'; degrees are --angles deg' * (most == 2)}"
            raise read.fault(int(np.argmax(wrong)), name, allowed)
    understood = (
        f"{header!r} as {name}{f' in {units[name]}' if name in units else ''}"
        for name, header in headers.items()
    )
    notes = [
        f"read: {'; '.join(understood)}",
        f"file: names of columns in line {text.dialect.header}, separator {text.dialect.separator}, "
        f"decimal {text.dialect.decimal}, encoding {text.dialect.encoding}",
        *([f"not used: {', '.join(options.ignore)}"] if options.ignore else []),
    ]
    return read.texts("joint") if "joint" in headers else [], rows, notes


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
    """The robot of a kinematics file, its links in the order of the arm; other keys and
    what is no number are refused."""
    source = Path(path).as_posix()
    document = read_document(path)
    wanted = f"links, each with {', '.join(_KEYS)}"
    if not isinstance(document, dict) or _KINEMATICS not in document:
        raise InputError(
            source,
            "",
            f"no {_KINEMATICS}",
            f"{_KINEMATICS} as ROS drivers write them, or a table as .csv",
        )
    described = document[_KINEMATICS]
    if not isinstance(described, dict):
        raise InputError(source, _KINEMATICS, type(described).__name__, wanted)
    # A digest of the calibration stands beside the links.
    links = {str(link): origin for link, origin in described.items() if link != "hash"}
    if not links:
        raise InputError(source, _KINEMATICS, "no link", wanted)
    if set(links) <= {*_JOINTS}:
        links = {link: links[link] for link in _JOINTS if link in links}
        if missing := [
            link
            for link in [*_JOINTS][: [*_JOINTS].index([*links][-1])]
            if link not in links
        ]:
            raise InputError(
                source,
                _KINEMATICS,
                f"no link {missing[0]}",
                f"every link before {[*links][-1]}",
            )
    words: list[str] = []
    for number, (link, origin) in enumerate(links.items(), 1):
        where = f"{_KINEMATICS}.{link}"
        if not isinstance(origin, dict) or set(origin) != set(_KEYS):
            found = (
                ", ".join(map(str, origin))
                if isinstance(origin, dict)
                else type(origin).__name__
            )
            raise InputError(source, where, found or "nothing", ", ".join(_KEYS))
        values: list[float] = []
        for key in _KEYS:
            if (value := parse_number(str(origin[key]))) is None:
                raise InputError(
                    source, f"{where}.{key}", repr(origin[key]), NUMBER_ALLOWED
                )
            values.append(value)
        words += [
            *displacement_words(origin_transform(values[:3], values[3:])),
            f"Rz(q{number})",
        ]
    names = [_JOINTS.get(link, link) for link in links]
    chain = " ".join([*words, f"[{point_name([*links][-1])}]"])
    contents = {"name": name or Path(path).stem, "joint_names": names, "chain": chain}
    notes = [
        f"read: {', '.join(f'q{n} is {name} of {link!r}' for n, (name, link) in enumerate(zip(names, links, strict=True), 1))}",
        *(["not used: hash"] if "hash" in described else []),
        *_LACKS,
        "base axes are the controller's (base, not base_link, which is turned half round)",
    ]
    return check_imported(
        contents, path, "the kinematics of a calibrated robot as ROS has them", notes
    )
