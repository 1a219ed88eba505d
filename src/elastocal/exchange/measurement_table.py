"""Measurements of another program's table, as a campaign has them.

What a name, a unit or a notation leaves open is asked for, never guessed: an angle without unit, ``rx, ry, rz`` that may be a
rotation vector or Euler angles. What was found out is returned as options with which the import can be repeated.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from elastocal.campaigns.column_bounds import BOUNDS, beyond
from elastocal.campaigns.measurements import closest_first, file_columns, shown
from elastocal.errors import InputError, text_fault
from elastocal.exchange.column_names import (
    ANGLE,
    COVARIATES,
    EULER,
    LENGTH,
    NONE,
    POSITION,
    TIME,
    UNITS,
    USUAL,
    VECTOR,
    is_name,
    is_unit_of_none,
    joints_in,
    kind_of,
    ordinal_of_joint,
    recognized,
    unit_of_joint,
    unit_scale,
    units_in,
    units_of,
)
from elastocal.exchange.csv_dialect import Dialect, read_text_table
from elastocal.exchange.joint_states import joints_by_name
from elastocal.exchange.markers import chosen_markers, has_position, markers_in, one_row_each
from elastocal.exchange.planned_sheet import sheet_options
from elastocal.exchange.rotations import (
    ALLOWED,
    HOMOGENEOUS_MATRICES,
    MATRICES,
    NO_ROTATION,
    QUATERNIONS,
    UNIT_LENGTH,
    columns_of_rotation,
    is_rotation,
    rotation_vectors,
)
from elastocal.io.texts import A_NUMBER, plain_number
from elastocal.mechanics.components import WRENCH_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from elastocal.exchange.csv_dialect import TextTable
    from elastocal.mechanics.robot import Robot

ON_ROBOT, BY_ROBOT = "on-robot", "by-robot"
# Angles that a controller reports twice at one standstill agree to better; poses of a plan lie degrees apart.
SAME_POSE = 1e-3
_TRANSLATION = ("t14", "t24", "t34")
# Rows of one pose whose joints stand farther apart (rad or m) are not of one pose: a label says something else.
_ONE_POSE = 0.1
# Nanoseconds since 1970 are 2e18.
_LARGEST_TIME = 1e19
# Columns that a table may have in two meanings: external axes E1 to E3 beside an orientation.
_OTHER_ANGLES = (("A", "B", "C"), ("W", "P", "R"), ("O", "A", "T"))
# Without a unit, seconds since 1970 of the years 1990 to 2100 cannot be seconds, minutes or hours of a campaign in these.
_EPOCH_S = 6.3e8, 4.1e9
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p")
_DATES = ("%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M")
# Of a pose, load, repeat or session; as in measurements.csv.
_LARGEST_ORDINAL = 2**31 - 1


@dataclass(frozen=True)
class ImportOptions:
    """How a table is read; what is None or absent is found out, or refused where it is ambiguous.

    `separator`, `decimal`, `header`, `encoding`, `thousands`: as in `csv_dialect.Dialect`. `ignore`: headers of columns that
    are left out. `columns`: headers by the names of `column_names`. `units`: units by the same names; ``angles`` and
    ``lengths`` for all that have no other. `rotation`: notation of `rotations`. `target`: name for all rows where no column has
    it. `targets`: markers of rows that hold several, by the names of the targets that they are; see `markers`. `wrench`: what
    the forces act on; those that the robot exerts are turned round. `skip_empty`: whether rows without a position are left out.
    """

    separator: str | None = None
    decimal: str | None = None
    header: int | None = None
    columns: Mapping[str, str] | None = None
    units: Mapping[str, str] | None = None
    rotation: str | None = None
    target: str | None = None
    wrench: str = ON_ROBOT
    skip_empty: bool = False
    encoding: str | None = None
    thousands: str | None = None
    ignore: Sequence[str] | None = None
    targets: Mapping[str, str] | None = None


@dataclass(frozen=True)
class ImportedMeasurements:
    """Measurements as a campaign has them.

    `table` (N,): columns of measurements.csv. `options`: with which the same comes out again: nothing is left to be found out.
    `ignored`: headers of columns that are not used. `skipped`: rows without a position that were left out. `notes`: how columns
    were understood that may surprise, and what else was left out.
    """

    table: dict[str, np.ndarray]
    joints: int
    options: ImportOptions
    ignored: tuple[str, ...]
    skipped: int
    notes: tuple[str, ...] = ()


def read_measurement_table(path: str | Path, options: ImportOptions, robot: Robot | None = None) -> ImportedMeasurements:
    """Read measurements from a table of another program.

    `robot`: whose joints they are: columns may be called as its file names them, and there have to be as many. Raises
    `InputError`: what is missing or ambiguous, with the option that says it; or line and column of what is no number or no
    rotation.
    """
    mapped = dict(options.columns or {})
    for name in (*mapped, *(set(options.units or {}) - {"angles", "lengths"})):
        if not is_name(name):
            raise InputError("--column", "", repr(name), closest_first(name, [*file_columns(6), "qw", "e1", "r11", "t11"]))

    def is_header(cells: Sequence[str]) -> bool:
        names = {recognized(cell)[0] for cell in cells} | {name for name, header in mapped.items() if header in cells}
        return has_position(names) or bool(markers_in(cells))

    dialect = Dialect(options.separator, options.decimal, options.header, options.encoding, options.thousands)
    text = read_text_table(path, is_header, dialect, options.ignore or (), units_in=units_in)
    options = sheet_options(text, options)
    mapped, notes = dict(options.columns or {}), [f"units in the row under the header: {len(text.units)}"] if text.units else []
    if targets := chosen_markers(text, options.target, options.targets, mapped):
        text, mapped, of_targets = one_row_each(text, targets, mapped)
        options, notes = replace(options, target=None, targets=targets), [*notes, *of_targets]
    columns, stated, counted = _columns(text, mapped, robot)
    notes += counted
    rotation = _rotation(text, columns, mapped, options.rotation)
    position = _TRANSLATION if rotation == HOMOGENEOUS_MATRICES else POSITION
    angles = joints_in(columns)
    orientation = columns_of_rotation(rotation, columns)
    _check_complete(text, columns, angles, (*position, *orientation), robot)
    wanted = [*angles, *position, *orientation, *(name for name in WRENCH_NAMES if name in columns)]
    units = _units(text, columns, wanted, stated, options.units or {}, robot)
    read = _Reader(text, columns, units, _kept(text, columns, position, options.skip_empty))
    covariates = _covariates(read, mapped, stated, options.units or {}, notes)
    table = _numbered(read, angles, mapped)
    table |= {name: read.numbers(name) for name in angles}
    table |= _wrench(read, options.wrench)
    table |= {axis: read.numbers(name) for axis, name in zip(POSITION, position, strict=True)}
    if orientation:
        table |= dict(zip(VECTOR, _vectors(read, rotation, orientation).T, strict=True))
    table |= covariates
    table |= {f"approach{j}": read.numbers(f"approach{j}") for j in range(1, len(angles) + 1) if f"approach{j}" in columns}
    table["target"] = _targets(read, options.target)
    table |= _ordinals(read, table)
    used = {*wanted, *table}
    resolved = replace(
        options,
        **asdict(text.dialect),
        columns={name: header for name, header in columns.items() if name in used and not (name == "target" and targets)},
        units=units,
        rotation=rotation,
    )
    read_headers = {columns[name] for name in columns if name in used}
    ignored = tuple(header for header in text.columns if header not in read_headers)
    skipped = len(text.lines) - len(read.kept)
    return ImportedMeasurements(
        table, len(angles), resolved, (*ignored, *(options.ignore or ())), skipped, (*text.left_out, *notes)
    )


def _columns(
    text: TextTable, mapped: Mapping[str, str], robot: Robot | None
) -> tuple[dict[str, str], dict[str, str], list[str]]:
    """Headers by name, those of the options first, the units that headers state, and notes."""
    found: dict[str, str] = {}
    for name, header in mapped.items():
        if header not in text.columns:
            raise InputError(text.path, "header", f"no column {header!r}", closest_first(header, list(text.columns)))
        found[name] = header
    guesses = {header: (name, _unit(text, header, unit)) for header in text.columns for name, unit in [recognized(header)]}
    by_name = {}
    for joint, called in enumerate((robot and robot.joint_names) or (), 1):
        for header in text.columns:
            is_joint, unit = unit_of_joint(header, called)
            if is_joint:
                guesses[header], by_name[header] = (f"q{joint}", _unit(text, header, unit)), called
    for header, name in joints_by_name(text, (robot and robot.joint_names) or (), {*mapped.values()}).items():
        guesses[header], by_name[header] = (name, guesses[header][1]), name
    free = [header for header in text.columns if header not in by_name and guesses[header][0] not in mapped]
    joints, notes = _counted_joints(text, free, {*mapped.values()})
    guesses |= {header: (name, guesses[header][1]) for header, name in joints.items()}
    stated: dict[str, str] = {}
    for header, (guess, unit) in guesses.items():
        meant = next((name for name, named in mapped.items() if named == header), guess)
        if meant is None or mapped.get(meant, header) != header:
            continue
        if found.get(meant, header) != header:
            allowed = f"--column {meant}=NAME, or --ignore NAME"
            raise InputError(text.path, "header", f"both {found[meant]!r} and {header!r} for {meant}", allowed)
        if meant not in mapped and is_unit_of_none(meant, unit):
            allowed = (
                f"--ignore {header!r}, --column {meant}={header!r} where it numbers or names each {meant}, or --column NAME=…"
            )
            raise InputError(text.path, "header", f"{header!r}, a {meant} with a unit", allowed)
        found[meant] = header
        if unit is not None:
            stated[meant] = unit
    return found, stated, notes


def _unit(text: TextTable, header: str, stated: str | None) -> str | None:
    """Unit of a column by its header or by the row under it, which may not contradict each other."""
    below = text.units.get(header)
    if stated and below and stated != below:
        allowed = f"one unit; --ignore {header!r}, or a table with one of them"
        raise InputError(text.path, "header", f"{header!r} and {below!r} in the row under it", allowed)
    return stated or below


def _counted_joints(text: TextTable, headers: Sequence[str], mapped: set[str]) -> tuple[dict[str, str], list[str]]:
    """Names of joints that headers count, and notes; what may be a quaternion, or is counted in two ways, is asked for."""
    families: dict[str, dict[int, str]] = {}
    for header in headers:
        if counted := ordinal_of_joint(header):
            families.setdefault(counted[0], {}).setdefault(counted[1], header)
    # What options name needs no question, unless they name a part of what is counted from 0.
    families = {
        name: members if 0 in members and not mapped >= {*members.values()} else free
        for name, members in families.items()
        if (free := {number: header for number, header in members.items() if header not in mapped})
    }
    for members in families.values():
        headers = [members[number] for number in sorted(members)]
        if sorted(members) in ([0, 1, 2, 3], [1, 2, 3, 4]) and _have_unit_length(text, headers):
            other = next((each for each in families.values() if each is not members), {1: "NAME"})
            first = other[min(other)]
            allowed = (
                f"--column qw={headers[0]!r} … qz={headers[3]!r} (real part first) and --column q1={first!r} …, or "
                f"for joints --column q1={headers[0]!r} …"
            )
            raise InputError(
                text.path, "header", f"{', '.join(headers)}: joints, or quaternions, as they have length 1", allowed
            )
    numbered = [set(members) - {0} for members in families.values()]
    if len(families) > 1 and not set.intersection(*numbered):
        named = " and ".join(repr(members[min(members)]) for members in families.values())
        raise InputError(
            text.path, "header", f"joints called {named} …", "--column q1=NAME …, or --ignore NAME for those of one kind"
        )
    for members in families.values():
        if 0 not in members:
            continue
        headers = [members[number] for number in sorted(members)]
        if len(members) != max(members) + 1 or len(members) == 4 or mapped & {*members.values()}:
            allowed = f"--column q1={headers[0]!r} …, each joint's"
            raise InputError(text.path, "header", f"{', '.join(headers)}, counted from 0", allowed)
        return (
            {header: f"q{number + 1}" for number, header in members.items()},
            [f"joints counted from 0: q1 is {headers[0]!r}, q{len(headers)} is {headers[-1]!r}"],
        )
    return {}, []


def _have_unit_length(text: TextTable, headers: Sequence[str]) -> bool:
    rows = [[plain_number(cell) for cell in cells] for cells in zip(*(text.columns[header] for header in headers), strict=True)]
    numbers = np.array([row for row in rows if None not in row], float)
    return len(numbers) > 0 and bool((np.abs(np.linalg.norm(numbers, axis=1) - 1.0) <= UNIT_LENGTH).all())


def _rotation(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str], notation: str | None) -> str:
    if notation is not None:
        if not is_rotation(notation):
            raise InputError("--rotation", "", repr(notation), ALLOWED)
        orientation = columns_of_rotation(notation, columns)
        if orientation == EULER:
            _check_external_axes(text, columns, mapped)
        return notation
    for certain in (HOMOGENEOUS_MATRICES, QUATERNIONS, MATRICES):
        if all(name in columns for name in columns_of_rotation(certain, columns)):
            return certain
    if angles := [columns[name] for name in (*VECTOR, *EULER) if name in columns]:
        allowed = f"--rotation vector, euler:ZYX, euler:xyz … or none: {ALLOWED}"
        raise InputError(text.path, "header", f"orientations {', '.join(angles)} of an unknown notation", allowed)
    return NO_ROTATION


def _check_external_axes(text: TextTable, columns: Mapping[str, str], mapped: Mapping[str, str]) -> None:
    """Ask where angles ``E1`` to ``E3`` may be external axes, as other columns look like the orientation."""
    plain = {
        recognized_name: header
        for header in text.columns
        if (recognized_name := header.split("[")[0].split("(")[0].strip().upper())
    }
    guessed = [columns[name] for name in EULER if name in columns and name not in mapped]
    others = [[plain[letter] for letter in letters] for letters in _OTHER_ANGLES if all(letter in plain for letter in letters)]
    more = [header for name, header in plain.items() if name in ("E4", "E5", "E6")]
    if guessed and (others or more):
        other_names = others[0] if others else ["NAME", "NAME", "NAME"]
        allowed = " ".join(f"--column {name}={header!r}" for name, header in zip(EULER, other_names, strict=True))
        own = " or ".join([f"{', '.join(guessed)} (external axes?)", *(", ".join(each) for each in others)])
        raise InputError(text.path, "header", f"orientations in {own}", f"{allowed}, or the same with {', '.join(guessed)}")


def _check_complete(
    text: TextTable, columns: Mapping[str, str], angles: Sequence[str], needed: Sequence[str], robot: Robot | None
) -> None:
    if not angles:
        named = f" or as the robot has them: {', '.join(robot.joint_names)}" if robot and robot.joint_names else ""
        allowed = (
            f"columns q1, q2 …{named}, --column q1=NAME, or --robot FILE with joint_names; "
            f"not yet used: {_not_used(text, columns)}"
        )
        raise InputError(text.path, "header", "no joint angles", allowed)
    if robot and len(angles) > robot.joints:
        found = f"{len(angles)} joints: {', '.join(columns[name] for name in angles)}"
        raise InputError(text.path, "header", found, f"{robot.joints}, as {robot.name} has; --ignore NAME leaves a column out")
    last = robot.joints if robot else int(angles[-1][1:])
    groups = [[f"q{j}" for j in range(1, last + 1)], needed]
    for group in groups:
        if missing := [name for name in group if name not in columns]:
            allowed = f"--column {missing[0]}=NAME; not yet used: {_not_used(text, columns)}"
            raise InputError(text.path, "header", f"no column {', '.join(missing)}", allowed)


def _not_used(text: TextTable, columns: Mapping[str, str]) -> str:
    return ", ".join(header for header in text.columns if header not in columns.values())[:200] or "none"


def _units(
    text: TextTable,
    columns: Mapping[str, str],
    wanted: Sequence[str],
    stated: Mapping[str, str],
    given: Mapping[str, str],
    robot: Robot | None = None,
) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in wanted:
        kinds = kind_of(name)
        if robot and name in joints_in([name]):
            # A prismatic joint reports a length.
            kinds = (LENGTH if robot.chain.prismatic[int(name[1:]) - 1] else ANGLE,)
        if kinds == (NONE,):
            continue
        for_all = given.get("lengths" if kinds[0] == LENGTH else "angles")
        # Options go before headers, those for one column before those for all.
        unit = given.get(name) or stated.get(name) or USUAL.get(kinds[0]) or for_all
        if unit is None:
            option = "--lengths mm" if kinds[0] == LENGTH else "--angles deg"
            raise InputError(text.path, "header", f"no unit of {columns[name]!r}", f"{option} or such, or --unit {name}=UNIT")
        if unit_scale(unit, kinds) is None:
            allowed = f"{', '.join(units_of(kinds))}, by --unit {name}=UNIT"
            raise InputError(text.path, f"unit of {columns[name]!r}", repr(unit), allowed)
        found[name] = unit
    return found


def _kept(text: TextTable, columns: Mapping[str, str], position: Sequence[str], skip_empty: bool) -> np.ndarray:
    """Rows that have a position."""
    filled = np.array([[bool(cell) for cell in text.columns[columns[name]]] for name in position]).all(axis=0)
    if not filled.all() and not skip_empty:
        row = int(np.argmin(filled))
        of = f" of {text.columns[columns['target']][row]}" if "target" in columns else ""
        raise InputError(text.path, f"line {text.lines[row]}", f"no position{of}", "three numbers, or --skip-empty to leave such rows out")
    if not filled.any():
        raise InputError(text.path, "", "no position in any row", "at least one measurement")
    return np.flatnonzero(filled)


class _Reader:
    """Cells as numbers in SI units, with the line of what is none."""

    def __init__(self, text: TextTable, columns: Mapping[str, str], units: dict[str, str], kept: np.ndarray) -> None:
        self.text, self.columns, self.units, self.kept = text, columns, units, kept

    def fault(self, index: int, name: str, allowed: str) -> InputError:
        """InputError of one cell; `index` counts the rows kept."""
        row = self.kept[index]
        header = self.columns[name]
        where = f"line {self.text.lines[row]}, column {header}"
        return InputError(self.text.path, where, shown(self.text.columns[header][row]), allowed)

    def cells(self, name: str) -> list[str]:
        """list of str (N,)."""
        cells = self.text.columns[self.columns[name]]
        return [cells[row] for row in self.kept]

    def times(self, name: str) -> np.ndarray:
        """ndarray (N,), s: as numbers, a time of day or a date; of dates since 1970, at Greenwich where no zone is stated."""
        cells = self.cells(name)
        numbers = [plain_number(cell, _LARGEST_TIME) for cell in cells]
        if None in numbers:
            values = _clock_times(cells)
            if values is None:
                allowed = "numbers, times as 10:20:33 or dates as 2023-05-04 10:20:33 (05/04/2023 may be two days)"
                raise self.fault(numbers.index(None), name, allowed)
            return values
        values = np.array(numbers, float) * UNITS[TIME][self.units[name]]
        if (index := beyond(name, values)) is not None:
            raise self.fault(index, name, BOUNDS[name].allowed)
        return values

    def unit_of_epoch(self, name: str) -> str | None:
        """Unit in which all numbers are times of this age since 1970, which no campaign lasts; None where they are not."""
        values = np.array([plain_number(cell, _LARGEST_TIME) or 0.0 for cell in self.cells(name)])
        small = (values.min(), values.max())
        return next(
            (
                unit
                for unit in ("ms", "us", "ns")
                if all(_EPOCH_S[0] <= each * UNITS[TIME][unit] <= _EPOCH_S[1] for each in small)
            ),
            None,
        )

    def numbers(self, name: str) -> np.ndarray:
        """ndarray (N,), SI units."""
        cells = self.cells(name)
        values = np.array([np.nan if (value := plain_number(cell)) is None else value for cell in cells])
        if not np.isfinite(values).all():
            raise self.fault(int(np.argmin(np.isfinite(values))), name, A_NUMBER)
        unit = self.units.get(name)
        values = values if unit is None else values * (unit_scale(unit, kind_of(name)) or 1.0)
        if (index := beyond(name, values)) is not None:
            raise self.fault(index, name, BOUNDS[name].allowed)
        return values

    def integers(self, name: str) -> np.ndarray:
        """ndarray of int (N,)."""
        values = self.numbers(name)
        wrong = (values != np.round(values)) | (np.abs(values) > _LARGEST_ORDINAL)
        if wrong.any():
            raise self.fault(int(np.argmax(wrong)), name, f"an integer, up to {_LARGEST_ORDINAL}")
        return values.astype(np.int64)


def _clock_times(cells: Sequence[str]) -> np.ndarray | None:
    """Seconds of times or dates, all written in one way, ndarray (N,), on over midnight; None where they are none."""
    try:
        dates = [datetime.fromisoformat(cell.replace("/", "-")) for cell in cells if "-" in cell or "/" in cell]
        if len(dates) == len(cells) and len({date.tzinfo is None for date in dates}) == 1:
            return np.array([(date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp() for date in dates])
    except ValueError:
        return None
    for written in (*_CLOCKS, *_DATES):
        try:
            times = [datetime.strptime(cell, written).replace(tzinfo=UTC) for cell in cells]
        except ValueError:
            continue
        if written in _DATES:
            return np.array([time.timestamp() for time in times])
        seconds = np.array(
            [(time - times[0].replace(hour=0, minute=0, second=0, microsecond=0)).total_seconds() for time in times]
        )
        return seconds + 86400.0 * np.concatenate([[0], np.cumsum(np.diff(seconds) < -43200.0)])
    return None


def _covariates(
    read: _Reader, mapped: Mapping[str, str], stated: Mapping[str, str], given: Mapping[str, str], notes: list[str]
) -> dict[str, np.ndarray]:
    """Time, temperature and uncertainty; of the first two is left out, with a note, what nobody asked for and is no number."""
    found = {}
    for name in COVARIATES:
        if name not in read.columns:
            continue
        text = any(plain_number(cell, _LARGEST_TIME) is None for cell in read.cells(name))
        try:
            unit = stated.get(name) or given.get(name)
            if name == "time_s" and unit is None and (unit := read.unit_of_epoch(name)):
                notes.append(f"{read.columns[name]!r} taken for {unit} since 1970")
            read.units |= _units(read.text, read.columns, [name], stated, {**given, **({name: unit} if unit else {})})
            found[name] = read.times(name) if name == "time_s" else read.numbers(name)
            if name == "time_s" and text:
                notes.append(f"{read.columns[name]!r} read as times of day or dates, such as {read.cells(name)[0]!r}, in s")
        except InputError as error:
            if name in mapped or name in given or name == "u95_m" or not text:
                allowed = f"{error.allowed}, or --ignore {read.columns[name]!r}"
                raise InputError(error.source, error.key, error.found, allowed) from None
            read.units.pop(name, None)
            notes.append(f"{read.columns[name]!r} not read: {error.key} has {error.found}")
    return found


def _wrench(read: _Reader, acts: str) -> dict[str, np.ndarray]:
    there = [name for name in WRENCH_NAMES if name in read.columns]
    if not there:
        return {}
    sign = -1.0 if acts == BY_ROBOT else 1.0
    zeros = np.zeros(len(read.kept))
    # A minus sign before a zero would be read by people as a force.
    return {name: (sign * read.numbers(name) + 0.0 if name in there else zeros) for name in WRENCH_NAMES}


def _vectors(read: _Reader, rotation: str, names: Sequence[str]) -> np.ndarray:
    values = np.column_stack([read.numbers(name) for name in names])
    vectors, off = rotation_vectors(rotation, values)
    if off.any():
        allowed = "a quaternion of length 1" if rotation == QUATERNIONS else "a rotation matrix, row by row"
        raise read.fault(int(np.argmax(off)), names[0], allowed)
    return vectors


def _targets(read: _Reader, name: str | None) -> np.ndarray:
    if "target" in read.columns:
        names = read.cells("target")
        if fault := next((fault for each in set(names) if (fault := text_fault(each))), None):
            raise InputError(read.text.path, f"column {read.columns['target']}", *fault)
        return np.array(names)
    if name is None:
        raise InputError(
            read.text.path, "header", "no column target", "--target NAME, the target of all rows, or --column target=NAME"
        )
    if fault := text_fault(name):
        raise InputError("--target", "", *fault)
    return np.full(len(read.kept), name)


def _numbered(read: _Reader, angles: Sequence[str], mapped: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Session and pose: labels are numbered; where no column has it, a pose is what has the same joint angles."""
    table: dict[str, Any] = {}
    if "session" in read.columns:
        table["session"] = read.integers("session")
    if "pose" in read.columns:
        labels = read.cells("pose")
        numbered = all(label.isdigit() for label in labels)
        table["pose"] = read.integers("pose") if numbered else pd.factorize(pd.Series(labels))[0] + 1
        if "pose" not in mapped and "session" not in table:
            _check_poses(read, angles, table["pose"])
    else:
        table["pose"] = _same(np.column_stack([read.numbers(name) for name in angles]), SAME_POSE)
    return table


def _check_poses(read: _Reader, angles: Sequence[str], pose: np.ndarray) -> None:
    """Ask what a column is whose name says pose, but not its contents, such as the configuration of an arm: FUT."""
    values = pd.DataFrame({name: read.numbers(name) for name in angles}).groupby(pose)
    apart = (values.transform("max") - values.transform("min")).max(axis=1).to_numpy() > _ONE_POSE
    if apart.any():
        header = read.columns["pose"]
        allowed = f"one posture for each, or --ignore {header!r}, or --column pose=NAME (NAME {header!r} where it is right)"
        raise read.fault(int(np.argmax(apart)), "pose", allowed)


def _ordinals(read: _Reader, table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Loads and repeats: as their columns have them, or counted by first appearance."""
    states = pd.DataFrame({"session": table.get("session", 0), "pose": table["pose"], "target": table["target"]})
    wrench = pd.DataFrame({name: table.get(name, 0.0) for name in WRENCH_NAMES}, index=states.index)
    if "load" in read.columns:
        states["load"] = read.integers("load")
    else:
        loads = pd.concat([states[["session", "pose"]], wrench], axis=1)
        different = loads[wrench.any(axis=1)].drop_duplicates()
        different["load"] = different.groupby(["session", "pose"]).cumcount() + 1
        states["load"] = loads.merge(different, how="left")["load"].fillna(0).astype(np.int64)
    if "repeat" in read.columns:
        states["repeat"] = read.integers("repeat")
    else:
        states["repeat"] = states.groupby(["session", "pose", "load", "target"]).cumcount()
    return {name: states[name].to_numpy() for name in ("load", "repeat")}


def _same(values: np.ndarray, within: float) -> np.ndarray:
    """Number of each row by first appearance, from 1: one for rows that agree to `within`."""
    different, which = np.unique(values, axis=0, return_inverse=True)
    near = cKDTree(different)
    numbers = np.zeros(len(different), np.int64)
    number = 0
    for row in which:
        if not numbers[row]:
            number += 1
            alike = np.array(near.query_ball_point(different[row], within, p=np.inf))
            numbers[alike[numbers[alike] == 0]] = number
    return numbers[which]
