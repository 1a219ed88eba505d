"""Measurements of another program's table, as a campaign has them.

What a name, a unit or a notation leaves open is asked for, never guessed: an angle
without unit, ``rx, ry, rz`` that may be a rotation vector or Euler angles. What was
found out is returned, too.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from elastocal.campaigns.holdout import number_close_points
from elastocal.campaigns.measurements import describe_columns
from elastocal.campaigns.tables import Cells, Dialect, TextTable, read_text_table
from elastocal.counting import format_count
from elastocal.errors import InputError, find_text_fault, suggest_names
from elastocal.exchange.column_names import (
    HOMOGENEOUS_MATRICES,
    POSITION,
    QUATERNIONS,
    TRANSLATION,
    VECTOR,
    columns_of_rotation,
    find_columns,
    find_joints,
    find_rotation,
    find_units,
    has_position,
    is_name,
    lengths_in,
    read_units,
    recognize_column,
    rotation_vectors,
    scales_of,
)
from elastocal.io.texts import parse_number
from elastocal.mechanics.components import WRENCH_NAMES
from elastocal.mechanics.robot import Robot

# Angles that a controller reports twice at one standstill agree to better; poses of a
# plan lie degrees apart.
SAME_POSE = 1e-3
# Nanoseconds since 1970 are 2e18.
_LARGEST_TIME = 1e19
# What programs write where nothing was measured.
_EMPTY = re.compile(
    r"|[+-]?nan(\(\w+\))?|[-–—]+|#?n/?a|n\.a\.|null|none", re.IGNORECASE
)


@dataclass(frozen=True)
class ImportOptions(Dialect):
    """How a table is read; what is None or absent is found out, or refused where it is
    ambiguous.

    `ignore`: headers of columns that are left out. `columns`: headers by the names of
    `column_names`. `units`: units by the same names; ``angles`` and ``lengths`` for all
    that have no other. `rotation`: notation of `rotations`. `target`: name for all rows
    where no column has it. `targets`: of rows that hold several, headers of x, y and z
    by the targets' names. `wrench`: what the forces act on; those that the robot
    exerts, ``by-robot``, are turned round. `skip_empty`: whether rows without a
    position are left out. `names`: of the columns of a table without a header, in their
    order.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    rotation: str | None = None
    target: str | None = None
    wrench: str = "on-robot"
    skip_empty: bool = False
    ignore: Sequence[str] = ()
    targets: Mapping[str, Sequence[str]] = field(default_factory=dict)
    names: Sequence[str] = ()


def _one_row_each(text: TextTable, targets: Mapping[str, Sequence[str]]) -> TextTable:
    """A table with one row for each target of a row, whose position has the headers of
    the first target's."""
    for name, headers in targets.items():
        for header, axis in zip(headers, POSITION, strict=True):
            if header not in text.columns:
                raise InputError(
                    text.path,
                    "header",
                    f"no column {header!r}",
                    f"{axis} of {name}: {', '.join(text.columns)}",
                )
    units = [
        {text.units.get(h) or recognize_column(h)[1] for h in axis}
        for axis in zip(*targets.values(), strict=True)
    ]
    if any(len(each) > 1 for each in units):
        raise InputError(
            text.path,
            "header",
            "positions of targets in several units",
            "one unit for all targets",
        )
    others = {header for headers in targets.values() for header in headers}
    columns = {
        name: tuple(c for c in cells for _ in targets)
        for name, cells in text.columns.items()
        if name not in others
    }
    for headers in zip(*targets.values(), strict=True):
        columns[headers[0]] = tuple(
            c
            for row in zip(*(text.columns[h] for h in headers), strict=True)
            for c in row
        )
    columns["target"] = tuple(targets) * len(text.lines)
    return replace(
        text, columns=columns, lines=tuple(line for line in text.lines for _ in targets)
    )


def _filled_rows(
    text: TextTable,
    columns: Mapping[str, str],
    position: Sequence[str],
    skip_empty: bool,
) -> np.ndarray:
    """Rows that have a position; `skip_empty`: NaN, - and N/A are none either."""
    empty = _EMPTY.fullmatch if skip_empty else re.compile("").fullmatch
    filled = np.array(
        [[not empty(cell) for cell in text.columns[columns[name]]] for name in position]
    ).all(axis=0)
    if not filled.all() and not skip_empty:
        row = int(np.argmin(filled))
        of = (
            f" of {text.columns[columns['target']][row]}" if "target" in columns else ""
        )
        allowed = "three numbers, or --skip-empty to leave such rows out"
        raise InputError(
            text.path, f"line {text.lines[row]}", f"no position{of}", allowed
        )
    if not filled.any():
        raise InputError(
            text.path, "", "no position in any row", "at least one measurement"
        )
    return np.flatnonzero(filled)


def _times(read: Cells) -> np.ndarray:
    """Times (N,), s: of numbers, or of dates of ISO 8601: since 1970, at Greenwich
    without a zone."""
    cells = read.texts("time_s")
    numbers = [parse_number(cell, _LARGEST_TIME) for cell in cells]
    if None not in numbers:
        return read.bounded("time_s", np.array(numbers, float) * read.scales["time_s"])
    with suppress(ValueError, OverflowError):
        dates = pd.to_datetime(pd.Series(cells), format="ISO8601", utc=True)
        if dates.notna().all() and all("-" in cell or "/" in cell for cell in cells):
            return (dates - pd.Timestamp(0, tz="UTC")).dt.total_seconds().to_numpy()
    raise read.fault(
        numbers.index(None), "time_s", "numbers, or dates as 2023-05-04 10:20:33"
    )


@dataclass(frozen=True)
class ImportedMeasurements:
    """Measurements as a campaign has them.

    `table` (N,): columns of measurements.csv. `options`: those given, and what was
    found out. `ignored`: headers of columns that are not used. `skipped`: rows without
    a position that were left out. `notes`: how columns were understood that may
    surprise, and which were not read.
    """

    table: dict[str, np.ndarray]
    joints: int
    options: ImportOptions
    ignored: tuple[str, ...]
    skipped: int
    notes: tuple[str, ...] = ()


def read_measurement_table(
    path: str | Path, options: ImportOptions, robot: Robot | None = None
) -> ImportedMeasurements:
    """Read measurements from a table of another program.

    `robot`: whose joints they are: columns may be called as its file names them, and
    there have to be as many. Raises `InputError`: what is missing or ambiguous, with
    the option that says it; or line and column of what is no number or no rotation.
    """
    mapped = dict(options.columns)
    for name in (*mapped, *(set(options.units) - {"angles", "lengths"})):
        if not is_name(name):
            raise InputError(
                "--column",
                "",
                repr(name),
                suggest_names(name, [*describe_columns(6), "qw", "e1", "r11", "t11"]),
            )

    def is_header(cells: Sequence[str]) -> bool:
        if options.targets and {
            header for headers in options.targets.values() for header in headers
        } <= {*cells}:
            return True
        names = {recognize_column(cell)[0] for cell in cells} | {
            name for name, header in mapped.items() if header in cells
        }
        # Joints without a position are a header too, of which is said what it lacks.
        only_joints = (
            any(name and find_joints([name]) for name in names) and len(cells) > 1
        )
        return has_position(names) or (
            only_joints and not any(parse_number(cell) is not None for cell in cells)
        )

    text = read_text_table(
        path,
        is_header,
        options,
        options.ignore,
        units_in=read_units,
        names=options.names,
    )
    notes = (
        [f"units in the row under the header: {len(text.units)}"] if text.units else []
    )
    if options.targets:
        text = _one_row_each(text, options.targets)
        first = next(iter(options.targets.values()))
        mapped |= dict(zip(POSITION, first, strict=True)) | {"target": "target"}
        notes += [
            f"{name} has {', '.join(map(repr, headers))}"
            for name, headers in options.targets.items()
        ]
    columns, stated = find_columns(text, mapped, robot)
    if (
        find_joints(columns)
        and not has_position(columns)
        and (lengths := lengths_in(text.columns))
    ):
        allowed = "columns x, y, z of a point; distances alone, as of a draw wire or a ball bar, cannot be used yet"
        raise InputError(
            text.path,
            "header",
            f"{', '.join(map(repr, lengths))} and no position",
            allowed,
        )
    rotation = find_rotation(text, columns, options.rotation)
    position = TRANSLATION if rotation == HOMOGENEOUS_MATRICES else POSITION
    angles = find_joints(columns)
    orientation = columns_of_rotation(rotation, columns)
    _check_complete(text, columns, angles, (*position, *orientation), robot)
    wanted = [
        *angles,
        *position,
        *orientation,
        *(name for name in WRENCH_NAMES if name in columns),
    ]
    given = options.units
    units = find_units(text, columns, wanted, stated, given, robot)
    kept = _filled_rows(text, columns, position, options.skip_empty)
    read = text.cells(columns, scales_of(units), kept)
    table = _number_poses(read, angles)
    table |= {name: read.numbers(name) for name in angles}
    if forces := [name for name in WRENCH_NAMES if name in columns]:
        sign = -1.0 if options.wrench == "by-robot" else 1.0
        zeros = np.zeros(len(kept))
        # A minus sign before a zero would be read by people as a force.
        table |= {
            name: sign * read.numbers(name) + 0.0 if name in forces else zeros
            for name in WRENCH_NAMES
        }
    table |= {
        axis: read.numbers(name) for axis, name in zip(POSITION, position, strict=True)
    }
    if orientation:
        vectors, off = rotation_vectors(rotation, read.matrix(orientation))
        if off.any():
            allowed = (
                "a quaternion of length 1"
                if rotation == QUATERNIONS
                else "a rotation matrix, row by row"
            )
            raise read.fault(int(np.argmax(off)), orientation[0], allowed)
        table |= dict(zip(VECTOR, vectors.T, strict=True))
    for name in (
        name for name in ("time_s", "temperature_c", "u95_m") if name in columns
    ):
        try:
            unit = find_units(text, columns, [name], stated, given)
            one = text.cells({name: columns[name]}, scales_of(unit), kept)
            table[name] = _times(one) if name == "time_s" else one.numbers(name)
            units |= unit
        except InputError as error:
            # Time and temperature are left out where nobody asked for them.
            if name in mapped or name in given or name == "u95_m":
                raise InputError(
                    error.source,
                    error.key,
                    error.found,
                    f"{error.allowed}, or --ignore {columns[name]!r}",
                ) from None
            notes.append(f"{columns[name]!r} not read: {error.key} has {error.found}")
    table |= {
        f"approach{j}": read.numbers(f"approach{j}")
        for j in range(1, len(angles) + 1)
        if f"approach{j}" in columns
    }
    table["target"] = _targets(read, options.target)
    table |= _ordinals(read, table)
    used = {
        name: header for name, header in columns.items() if name in {*wanted, *table}
    }
    resolved = replace(
        options,
        **asdict(text.dialect),
        columns={
            name: header
            for name, header in used.items()
            if not (name == "target" and options.targets)
        },
        units=units,
        rotation=rotation,
    )
    ignored = (
        *(header for header in text.columns if header not in used.values()),
        *options.ignore,
    )
    skipped = len(text.lines) - len(kept)
    return ImportedMeasurements(
        table, len(angles), resolved, ignored, skipped, tuple(notes)
    )


def _check_complete(
    text: TextTable,
    columns: Mapping[str, str],
    angles: Sequence[str],
    needed: Sequence[str],
    robot: Robot | None,
) -> None:
    """Refuse a table without all joint angles of the robot (`angles`), or without one
    of the columns that are needed."""
    unused = (
        ", ".join(header for header in text.columns if header not in columns.values())[
            :200
        ]
        or "none"
    )
    if not angles:
        named = (
            f" or as the robot has them: {', '.join(robot.joint_names)}"
            if robot and robot.joint_names
            else ""
        )
        allowed = f"columns q1, q2 …{named}, --column q1=NAME, or --robot FILE with joint_names; not yet used: {unused}"
        raise InputError(text.path, "header", "no joint angles", allowed)
    if robot and len(angles) > robot.joints:
        found = f"{format_count(len(angles), 'joint')}: {', '.join(columns[name] for name in angles)}"
        raise InputError(
            text.path,
            "header",
            found,
            f"{robot.joints}, as {robot.name} has; --ignore NAME leaves a column out",
        )
    last = robot.joints if robot else int(angles[-1][1:])
    for group in ([f"q{j}" for j in range(1, last + 1)], needed):
        if missing := [name for name in group if name not in columns]:
            allowed = f"--column {missing[0]}=NAME; not yet used: {unused}"
            raise InputError(
                text.path, "header", f"no column {', '.join(missing)}", allowed
            )


def _targets(read: Cells, name: str | None) -> np.ndarray:
    if "target" not in read.columns and name is None:
        allowed = "--target NAME, the target of all rows, or --column target=NAME"
        raise InputError(read.path, "header", "no column target", allowed)
    names = (
        read.texts("target")
        if "target" in read.columns
        else [name or ""] * len(read.rows)
    )
    if fault := next(
        (fault for each in dict.fromkeys(names) if (fault := find_text_fault(each))),
        None,
    ):
        where = (
            (read.path, f"column {read.headers['target']}")
            if "target" in read.columns
            else ("--target", "")
        )
        raise InputError(*where, *fault)
    return np.array(names)


def _number_poses(read: Cells, angles: Sequence[str]) -> dict[str, np.ndarray]:
    """Session and pose: labels are numbered; where no column has it, a pose is what has
    the same joint angles."""
    table: dict[str, Any] = {}
    if "session" in read.columns:
        table["session"] = read.integers("session")
    if "pose" in read.columns:
        labels = read.texts("pose")
        numbered = all(label.isdigit() for label in labels)
        table["pose"] = (
            read.integers("pose")
            if numbered
            else pd.factorize(pd.Series(labels))[0] + 1
        )
    else:
        table["pose"] = number_close_points(read.matrix(angles), SAME_POSE) + 1
    return table


def _ordinals(read: Cells, table: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Loads and repeats: as their columns have them, or counted by first appearance."""
    states = pd.DataFrame(
        {
            "session": table.get("session", 0),
            "pose": table["pose"],
            "target": table["target"],
        }
    )
    wrench = pd.DataFrame(
        {name: table.get(name, 0.0) for name in WRENCH_NAMES}, index=states.index
    )
    if "load" in read.columns:
        states["load"] = read.integers("load")
    else:
        loads = pd.concat([states[["session", "pose"]], wrench], axis=1)
        different = loads[wrench.any(axis=1)].drop_duplicates()
        different["load"] = different.groupby(["session", "pose"]).cumcount() + 1
        states["load"] = (
            loads.merge(different, how="left")["load"].fillna(0).astype(np.int64)
        )
    if "repeat" in read.columns:
        states["repeat"] = read.integers("repeat")
    else:
        states["repeat"] = states.groupby(
            ["session", "pose", "load", "target"]
        ).cumcount()
    return {name: states[name].to_numpy() for name in ("load", "repeat")}
