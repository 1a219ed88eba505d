"""Measurements of another program's table, as a campaign has them.

What a name, a unit or a notation leaves open is asked for, never guessed: an angle without unit, ``rx, ry, rz`` that may be a
rotation vector or Euler angles. What was found out is returned as options with which the import can be repeated.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from elastocal.campaigns.column_bounds import BOUNDS, beyond
from elastocal.campaigns.measurements import closest_first, file_columns, shown
from elastocal.errors import InputError, text_fault
from elastocal.exchange.column_names import (
    COVARIATES,
    LENGTH,
    NONE,
    POSITION,
    USUAL,
    VECTOR,
    is_name,
    joints_in,
    kind_of,
    recognized,
    unit_scale,
    units_of,
)
from elastocal.exchange.csv_dialect import read_text_table
from elastocal.exchange.planned_sheet import sheet_options
from elastocal.exchange.rotations import (
    ALLOWED,
    HOMOGENEOUS_MATRICES,
    MATRICES,
    NO_ROTATION,
    QUATERNIONS,
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

ON_ROBOT, BY_ROBOT = "on-robot", "by-robot"
# Angles that a controller reports twice at one standstill agree to better; poses of a plan lie degrees apart.
SAME_POSE = 1e-3
_TRANSLATION = ("t14", "t24", "t34")
# Of a pose, load, repeat or session; as in measurements.csv.
_LARGEST_ORDINAL = 2**31 - 1


@dataclass(frozen=True)
class ImportOptions:
    """How a table is read; what is None or absent is found out, or refused where it is ambiguous.

    Attributes
    ----------
    separator, decimal : str or None
        As in `csv_dialect`.
    header : int or None
        Line of the names of columns, from 1.
    columns : dict of str to str
        Headers by the names of `column_names`.
    units : dict of str to str
        Units by the same names; ``angles`` and ``lengths`` for all that have no other.
    rotation : str or None
        Notation of `rotations`.
    target : str or None
        Name for all rows where no column has it.
    wrench : {"on-robot", "by-robot"}
        What the forces act on; those that the robot exerts are turned round.
    skip_empty : bool
        Whether rows without a position are left out.
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


@dataclass(frozen=True)
class ImportedMeasurements:
    """Measurements as a campaign has them.

    Attributes
    ----------
    table : dict of str to ndarray (N,)
        Columns of measurements.csv.
    joints : int
    options : ImportOptions
        With which the same comes out again: nothing is left to be found out.
    ignored : tuple of str
        Headers of columns that are not used.
    skipped : int
        Rows that were left out.
    """

    table: dict[str, np.ndarray]
    joints: int
    options: ImportOptions
    ignored: tuple[str, ...]
    skipped: int


def read_measurement_table(path: str | Path, options: ImportOptions) -> ImportedMeasurements:
    """Read measurements from a table of another program.

    Parameters
    ----------
    path : str or Path
    options : ImportOptions

    Returns
    -------
    ImportedMeasurements

    Raises
    ------
    InputError
        What is missing or ambiguous, with the option that says it; or line and column of what is no number or no rotation.
    """
    mapped = dict(options.columns or {})
    for name in (*mapped, *(set(options.units or {}) - {"angles", "lengths"})):
        if not is_name(name):
            raise InputError("--column", "", repr(name), closest_first(name, [*file_columns(6), "qw", "e1", "r11", "t11"]))

    def is_header(cells: Sequence[str]) -> bool:
        names = {recognized(cell)[0] for cell in cells} | {name for name, header in mapped.items() if header in cells}
        return set(POSITION) <= names or set(_TRANSLATION) <= names

    text = read_text_table(path, is_header, options.separator, options.decimal, options.header)
    options = sheet_options(text, options)
    mapped = dict(options.columns or {})
    columns, stated = _columns(text, mapped)
    rotation = _rotation(text, columns, options.rotation)
    position = _TRANSLATION if rotation == HOMOGENEOUS_MATRICES else POSITION
    angles = joints_in(columns)
    orientation = columns_of_rotation(rotation, columns)
    _check_complete(text, columns, angles, (*position, *orientation))
    wanted = [*angles, *position, *orientation, *(name for name in (*WRENCH_NAMES, *COVARIATES) if name in columns)]
    units = _units(text, columns, wanted, stated, options.units or {})
    read = _Reader(text, columns, units, _kept(text, columns, position, options.skip_empty))
    table = _numbered(read, angles)
    table |= {name: read.numbers(name) for name in angles}
    table |= _wrench(read, options.wrench)
    table |= {axis: read.numbers(name) for axis, name in zip(POSITION, position, strict=True)}
    if orientation:
        table |= dict(zip(VECTOR, _vectors(read, rotation, orientation).T, strict=True))
    table |= {name: read.numbers(name) for name in COVARIATES if name in columns}
    table |= {f"approach{j}": read.numbers(f"approach{j}") for j in range(1, len(angles) + 1) if f"approach{j}" in columns}
    table["target"] = _targets(read, options.target)
    table |= _ordinals(read, table)
    used = {*wanted, *table}
    resolved = replace(
        options,
        separator=text.dialect.separator,
        decimal=text.dialect.decimal,
        header=text.dialect.header,
        columns={name: header for name, header in columns.items() if name in used},
        units=units,
        rotation=rotation,
    )
    ignored = tuple(header for header in text.columns if header not in {"", *(resolved.columns or {}).values()})
    return ImportedMeasurements(table, len(angles), resolved, ignored, len(text.lines) - len(read.kept))


def _columns(text: TextTable, mapped: Mapping[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Headers by name, those of the options first, and the units that headers state."""
    found: dict[str, str] = {}
    for name, header in mapped.items():
        if header not in text.columns:
            raise InputError(text.path, "header", f"no column {header!r}", closest_first(header, list(text.columns)))
        found[name] = header
    stated: dict[str, str] = {}
    for header in text.columns:
        guess, unit = recognized(header)
        meant = next((name for name, named in mapped.items() if named == header), guess)
        if meant is None or mapped.get(meant, header) != header:
            continue
        if found.get(meant, header) != header:
            raise InputError(text.path, "header", f"both {found[meant]!r} and {header!r} for {meant}", f"--column {meant}=NAME")
        found[meant] = header
        if unit is not None:
            stated[meant] = unit
    return found, stated


def _rotation(text: TextTable, columns: Mapping[str, str], notation: str | None) -> str:
    if notation is not None:
        if not is_rotation(notation):
            raise InputError("--rotation", "", repr(notation), ALLOWED)
        return notation
    for certain in (HOMOGENEOUS_MATRICES, QUATERNIONS, MATRICES):
        if all(name in columns for name in columns_of_rotation(certain, columns)):
            return certain
    if angles := [columns[name] for name in (*VECTOR, "e1", "e2", "e3") if name in columns]:
        allowed = f"--rotation vector, euler:ZYX, euler:xyz … or none: {ALLOWED}"
        raise InputError(text.path, "header", f"orientations {', '.join(angles)} of an unknown notation", allowed)
    return NO_ROTATION


def _check_complete(text: TextTable, columns: Mapping[str, str], angles: Sequence[str], needed: Sequence[str]) -> None:
    if not angles:
        raise InputError(text.path, "header", "no joint angles", "columns q1, q2 …, or --column q1=NAME")
    groups = [[f"q{j}" for j in range(1, int(angles[-1][1:]) + 1)], needed]
    for group in groups:
        if missing := [name for name in group if name not in columns]:
            other = [header for header in text.columns if header not in columns.values()]
            allowed = f"--column {missing[0]}=NAME; not yet used: {', '.join(other)[:200] or 'none'}"
            raise InputError(text.path, "header", f"no column {', '.join(missing)}", allowed)


def _units(
    text: TextTable, columns: Mapping[str, str], wanted: Sequence[str], stated: Mapping[str, str], given: Mapping[str, str]
) -> dict[str, str]:
    found: dict[str, str] = {}
    for name in wanted:
        kinds = kind_of(name)
        if kinds == (NONE,):
            continue
        for_all = given.get("lengths" if kinds[0] == LENGTH else "angles")
        # Options go before headers, those for one column before those for all.
        unit = given.get(name) or stated.get(name) or USUAL.get(kinds[0]) or for_all
        if unit is None:
            option = "--lengths mm" if kinds[0] == LENGTH else "--angles deg"
            raise InputError(text.path, "header", f"no unit of {columns[name]!r}", f"{option} or such, or --unit {name}=UNIT")
        if unit_scale(name, unit) is None:
            allowed = f"{', '.join(units_of(name))}, by --unit {name}=UNIT"
            raise InputError(text.path, f"unit of {columns[name]!r}", repr(unit), allowed)
        found[name] = unit
    return found


def _kept(text: TextTable, columns: Mapping[str, str], position: Sequence[str], skip_empty: bool) -> np.ndarray:
    """Rows that have a position."""
    filled = np.array([[bool(cell) for cell in text.columns[columns[name]]] for name in position]).all(axis=0)
    if not filled.all() and not skip_empty:
        line = text.lines[int(np.argmin(filled))]
        raise InputError(text.path, f"line {line}", "no position", "three numbers, or --skip-empty to leave such rows out")
    if not filled.any():
        raise InputError(text.path, "", "no position in any row", "at least one measurement")
    return np.flatnonzero(filled)


class _Reader:
    """Cells as numbers in SI units, with the line of what is none."""

    def __init__(self, text: TextTable, columns: Mapping[str, str], units: Mapping[str, str], kept: np.ndarray) -> None:
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

    def numbers(self, name: str) -> np.ndarray:
        """ndarray (N,), SI units."""
        cells = self.cells(name)
        values = np.array([np.nan if (value := plain_number(cell)) is None else value for cell in cells])
        if not np.isfinite(values).all():
            raise self.fault(int(np.argmin(np.isfinite(values))), name, A_NUMBER)
        unit = self.units.get(name)
        values = values if unit is None else values * (unit_scale(name, unit) or 1.0)
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


def _numbered(read: _Reader, angles: Sequence[str]) -> dict[str, np.ndarray]:
    """Session and pose: labels are numbered; where no column has it, a pose is what has the same joint angles."""
    table: dict[str, Any] = {}
    if "session" in read.columns:
        table["session"] = read.integers("session")
    if "pose" in read.columns:
        labels = read.cells("pose")
        numbered = all(label.isdigit() for label in labels)
        table["pose"] = read.integers("pose") if numbered else pd.factorize(pd.Series(labels))[0] + 1
    else:
        table["pose"] = _same(np.column_stack([read.numbers(name) for name in angles]), SAME_POSE)
    return table


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
