"""Measurements from a table of another program, as a campaign has them.

The user is asked for what names, units and notations leave open, such as the unit of an
angle, or whether ``rx, ry, rz`` is a rotation vector or Euler angles; nothing is guessed.
The result states all options, including those that were recognized.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from elastocal.campaigns.measurements import CONDITIONS
from elastocal.campaigns.tables import Cells, TextTable, read_text_table
from elastocal.counting import format_count
from elastocal.errors import InputError, find_text_fault, suggest_names
from elastocal.exchange.column_names import (
    POSITION,
    VECTOR,
    find_columns,
    find_euler_columns,
    find_joints,
    find_lengths,
    find_rotation,
    find_scales,
    find_units,
    has_position,
    recognize_column,
)
from elastocal.exchange.joining import join_files, join_to_sheet
from elastocal.exchange.numbering import number_loads_and_repeats, number_poses
from elastocal.exchange.pose_table import (
    PoseTable,
    TableOptions,
    check_option_names,
    read_cells,
    read_rotation_vectors,
)
from elastocal.exchange.times import find_times_of_day, read_times
from elastocal.exchange.unwrapping import unwrap_into_limits
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns
from elastocal.mechanics.robot import Robot

# What programs write into a cell without a measurement.
_EMPTY = re.compile(
    r"|[+-]?nan(\(\w+\))?|[-–—]+|#?n/?a|n\.a\.|null|none", re.IGNORECASE
)
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class ImportOptions(TableOptions):
    """How a table of measurements is read.

    Attributes
    ----------
    target : name for all rows if no column has it.
    wrench : ``on-robot`` or ``by-robot``: what the forces act on. Forces that the robot
        exerts have their signs changed.
    skip_empty : whether rows without a position are left out.
    targets : headers of x, y and z by the names of the targets, if a row holds several.
    join : how rows are joined to the joint angles of another file, see `joining`.
    """

    target: str | None = None
    wrench: str = "on-robot"
    skip_empty: bool = False
    targets: Mapping[str, Sequence[str]] = field(default_factory=dict)
    join: str | None = None


@dataclass(frozen=True)
class ImportedMeasurements:
    """Measurements as a campaign has them.

    Attributes
    ----------
    table : columns of measurements.csv, ndarrays (N,).
    joints : number of joints.
    options : the given options, and those that were recognized.
    ignored : headers of columns that are not used.
    skipped : number of rows without a position that were left out.
    notes : which columns were understood in a way that may surprise, and which were not
        read.
    """

    table: dict[str, np.ndarray]
    joints: int
    options: ImportOptions
    ignored: tuple[str, ...]
    skipped: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _OptionalColumns:
    """Time, temperature and uncertainty of measurements: `columns` and `units` of those
    that could be read, by name, and `notes` about the others."""

    columns: dict[str, np.ndarray]
    units: dict[str, str]
    notes: list[str]


@dataclass(frozen=True)
class OtherFile:
    """Where the joint angles of positions are.

    Attributes
    ----------
    path : file with the joint angles.
    is_sheet : whether it is a sheet of `elastocal plan`, with names and units of
        measurements.csv; it counts only if the positions come without joint angles.
    is_partial : whether it may have rows without a position, which are left out.
    """

    path: Path
    is_sheet: bool = False
    is_partial: bool = False


@dataclass(frozen=True)
class _Source:
    """Cells with all columns of measurements, from one file or two.

    Attributes
    ----------
    text : the cells.
    headers : headers that are stated, by name.
    units : units that are stated, by name.
    notes : how the cells were understood.
    """

    text: TextTable
    headers: dict[str, str]
    units: dict[str, str]
    notes: list[str]


def read_measurement_table(
    path: str | Path,
    options: ImportOptions,
    robot: Robot | None = None,
    joint_file: OtherFile | None = None,
) -> ImportedMeasurements:
    """Read measurements from a table of another program.

    Parameters
    ----------
    path : file of the table
    options : how it is read
    robot : robot that was measured. Columns may have the names of its joints, and there
        must be a column for each joint.
    joint_file : file of the joint angles, if the table has the positions alone.

    Raises
    ------
    InputError
        Something is missing or ambiguous: the error has the option that states it. Or a
        cell is not a number, or not a rotation: the error has its line and column.
    """
    check_option_names(options)
    source = _read_source(path, options, robot, joint_file)
    text = source.text
    options = replace(options, units={**options.units, **source.units})
    layout = _find_layout(text, source.headers, options, robot)
    units = find_units(
        text,
        layout.columns,
        layout.with_units,
        layout.stated_units,
        options.units,
        robot,
    )
    rows = _find_filled_rows(layout, skip_empty=options.skip_empty)
    optional = _read_optional_columns(layout, source.headers, options, rows)
    cells = text.cells(layout.columns, find_scales(units), rows)
    joint_angles, unwrapping = _read_joint_angles(cells, layout, robot)
    table = _read_columns(cells, layout, options, joint_angles) | optional.columns
    used = {
        name: header
        for name, header in layout.columns.items()
        if name in table or name in layout.with_units
    }
    ignored = [header for header in text.columns if header not in used.values()]
    if options.targets:
        del used["target"]
    resolved = replace(
        options,
        **asdict(text.dialect),
        columns=used,
        units=units | optional.units,
        rotation=layout.rotation,
    )
    return ImportedMeasurements(
        table,
        len(layout.angles),
        resolved,
        (*ignored, *options.ignore),
        len(text.lines) - len(rows),
        (*source.notes, *unwrapping, *optional.notes),
    )


def _read_source(
    path: str | Path,
    options: ImportOptions,
    robot: Robot | None,
    joint_file: OtherFile | None,
) -> _Source:
    """Read the cells of a table, a row for each target, and join them to the joint
    angles if these are in another file."""
    target_headers = set[str]().union(*options.targets.values())
    dialect = options
    if joint_file is not None and not joint_file.is_sheet:
        names = options.names if _name_positions(options) else ()
        dialect = replace(options, names=names, ignore=())
    text = read_cells(path, dialect, target_headers)
    notes = []
    if text.units:
        notes.append(f"units in the row under the header: {len(text.units)}")
    headers = find_euler_columns(text, options.rotation) | dict(options.columns)
    if options.targets:
        text = _split_targets(text, options.targets)
        first_headers = next(iter(options.targets.values()))
        headers |= dict(zip(POSITION, first_headers, strict=True))
        headers["target"] = "target"
        notes += [
            f"{name} has {', '.join(map(repr, columns))}"
            for name, columns in options.targets.items()
        ]
    source = _Source(text, headers, {}, notes)
    if joint_file is None:
        return source
    skip_empty = options.skip_empty or joint_file.is_partial
    if joint_file.is_sheet:
        options = replace(options, skip_empty=skip_empty)
        return _join_sheet(source, options, robot, joint_file.path)
    joints = _read_joint_file(joint_file.path, options)
    joined = join_files(text, joints, options.join, skip_empty=skip_empty)
    text = _leave_out(joined.text, options.ignore)
    return _Source(text, headers, {}, notes + joined.notes)


def _read_joint_file(path: Path, options: ImportOptions) -> TextTable:
    """Read the cells of a file of joint angles."""
    names = () if _name_positions(options) else options.names
    return read_cells(path, replace(options, names=names, ignore=(), header=None))


def _name_positions(options: ImportOptions) -> bool:
    """Whether the stated names of columns are those of positions."""
    return has_position([recognize_column(name)[0] for name in options.names])


def _leave_out(text: TextTable, headers: Sequence[str]) -> TextTable:
    """Leave out columns of a table; an unknown one is refused."""
    for header in headers:
        if header not in text.columns:
            allowed = suggest_names(header, [*text.columns])
            raise InputError("--ignore", "", f"no column {header!r}", allowed)
    columns = {
        header: cells for header, cells in text.columns.items() if header not in headers
    }
    return replace(text, columns=columns)


def _join_sheet(
    source: _Source, options: ImportOptions, robot: Robot | None, path: Path
) -> _Source:
    """Join positions to a planned sheet if they come without joint angles."""
    text = source.text
    present = {
        name: header
        for name, header in source.headers.items()
        if header in text.columns
    }
    columns, _ = find_columns(text, present, robot)
    if find_joints(columns):
        return source
    sheet = read_text_table(path, lambda cells: "pose" in cells)
    joined = join_to_sheet(
        text,
        sheet,
        columns,
        options.target,
        options.join,
        skip_empty=options.skip_empty,
    )
    joints = find_joints(joined.columns)
    units = {
        name: "m" if robot and robot.prismatic_commands[number] else "rad"
        for number, name in enumerate(joints)
    }
    return _Source(
        joined.text,
        source.headers | joined.columns,
        units,
        source.notes + joined.notes,
    )


def _split_targets(text: TextTable, targets: Mapping[str, Sequence[str]]) -> TextTable:
    """Give each target of a row a row of its own.

    `targets`: headers of x, y and z by the names of the targets. The positions have the
    headers of the first target; a new column ``target`` has the names.
    """
    _check_target_headers(text, targets)
    # Headers of x of all targets, then of y, then of z.
    headers_by_axis = list(zip(*targets.values(), strict=True))
    positions = {header for headers in targets.values() for header in headers}
    columns = {
        header: _repeat_each(cells, len(targets))
        for header, cells in text.columns.items()
        if header not in positions
    }
    for headers in headers_by_axis:
        rows = zip(*(text.columns[header] for header in headers), strict=True)
        columns[headers[0]] = tuple(itertools.chain.from_iterable(rows))
    columns["target"] = tuple(targets) * len(text.lines)
    return replace(text, columns=columns, lines=_repeat_each(text.lines, len(targets)))


def _repeat_each(values: Sequence[_Value], count: int) -> tuple[_Value, ...]:
    return tuple(value for value in values for _ in range(count))


def _check_target_headers(
    text: TextTable, targets: Mapping[str, Sequence[str]]
) -> None:
    """Refuse headers that the table lacks, and targets in different units."""
    for name, headers in targets.items():
        for header, axis in zip(headers, POSITION, strict=True):
            if header not in text.columns:
                raise InputError(
                    text.path,
                    "header",
                    f"no column {header!r}",
                    f"{axis} of {name}: {', '.join(text.columns)}",
                )
    for headers in zip(*targets.values(), strict=True):
        units = {
            text.units.get(header) or recognize_column(header)[1] for header in headers
        }
        if len(units) > 1:
            raise InputError(
                text.path,
                "header",
                "positions of targets in several units",
                "one unit for all targets",
            )


def _find_layout(
    text: TextTable,
    headers: Mapping[str, str],
    options: ImportOptions,
    robot: Robot | None,
) -> PoseTable:
    """Find out what the columns of a table are; `headers`: those that are stated, by
    name."""
    columns, stated_units = find_columns(text, headers, robot)
    if find_joints(columns) and not has_position(columns):
        lengths = find_lengths(text.columns)
        if lengths:
            raise InputError(
                text.path,
                "header",
                f"{', '.join(map(repr, lengths))} and no position",
                (
                    "columns x, y, z of a point; distances alone, as of a draw wire or a"
                    " ball bar, cannot be used yet"
                ),
            )
    rotation = find_rotation(text, columns, options.rotation)
    layout = PoseTable(text, columns, stated_units, rotation)
    _check_complete(layout, robot)
    return layout


def _check_complete(layout: PoseTable, robot: Robot | None) -> None:
    """Refuse a table without all joint angles of the robot, or without a column that
    its positions or orientations need."""
    path = layout.text.path
    columns = layout.columns
    unused_headers = [
        header for header in layout.text.columns if header not in columns.values()
    ]
    unused = f"not yet used: {', '.join(unused_headers)[:200] or 'none'}"
    angles = layout.angles
    if not angles:
        raise _no_angles_error(layout, robot, unused)
    if robot and len(angles) > robot.commands:
        headers = ", ".join(columns[name] for name in angles)
        raise InputError(
            path,
            "header",
            f"{format_count(len(angles), 'joint')}: {headers}",
            f"{robot.commands}, as {robot.name} has; --ignore NAME leaves a column out",
        )
    joints = robot.commands if robot else int(angles[-1][1:])
    all_angles = list_joint_columns(joints)
    for needed in (all_angles, [*layout.position, *layout.orientation]):
        missing = [name for name in needed if name not in columns]
        if missing:
            raise InputError(
                path,
                "header",
                f"no column {', '.join(missing)}",
                f"--column {missing[0]}=NAME{_describe_other_file(missing)}; {unused}",
            )


def _describe_other_file(missing: Sequence[str]) -> str:
    """Say how positions of another file are joined, if these are missing."""
    if "x" in missing:
        return ", or the table of positions with --joints FILE for this one"
    return ""


def _no_angles_error(layout: PoseTable, robot: Robot | None, unused: str) -> InputError:
    """Make the error of a table without joint angles."""
    joint_names = ""
    if robot and robot.command_names:
        joint_names = f" or as the robot has them: {', '.join(robot.command_names)}"
    return InputError(
        layout.text.path,
        "header",
        "no joint angles",
        f"columns q1, q2 …{joint_names}, --column q1=NAME, --robot FILE with joint_names,"
        f" --joints FILE that has them, or a planned sheet in --folder; {unused}",
    )


def _find_filled_rows(layout: PoseTable, *, skip_empty: bool) -> np.ndarray:
    """Find the rows that have a position, ndarray of int.

    With `skip_empty`, cells such as NaN, - and N/A are empty too. Without it, an empty
    cell is an error.
    """
    text = layout.text
    columns = layout.columns
    is_empty = _EMPTY.fullmatch if skip_empty else re.compile("").fullmatch
    filled = np.ones(len(text.lines), bool)
    for name in layout.position:
        filled &= [not is_empty(cell) for cell in text.columns[columns[name]]]
    if not filled.all() and not skip_empty:
        row = int(np.argmin(filled))
        target = ""
        if "target" in columns:
            target = f" of {text.columns[columns['target']][row]}"
        raise InputError(
            text.path,
            f"line {text.lines[row]}",
            f"no position{target}",
            "three numbers, or --skip-empty to leave such rows out",
        )
    if not filled.any():
        raise InputError(
            text.path, "", "no position in any row", "at least one measurement"
        )
    return np.flatnonzero(filled)


def _read_columns(
    cells: Cells, layout: PoseTable, options: ImportOptions, joint_angles: np.ndarray
) -> dict[str, np.ndarray]:
    """Read all columns that measurements need, with these joint angles (N, n)."""
    table = number_poses(cells, joint_angles)
    table |= dict(zip(layout.angles, joint_angles.T, strict=True))
    if layout.wrench:
        sign = -1.0 if options.wrench == "by-robot" else 1.0
        for name in WRENCH_NAMES:
            table[name] = np.zeros(len(cells.rows))
            if name in layout.wrench:
                # Adding zero removes the minus sign of a zero, which people would read
                # as a force.
                table[name] = sign * cells.numbers(name) + 0.0
    for axis, name in zip(POSITION, layout.position, strict=True):
        table[axis] = cells.numbers(name)
    if layout.orientation:
        vectors = read_rotation_vectors(cells, layout)
        table |= dict(zip(VECTOR, vectors.T, strict=True))
    for joint in layout.angles:
        approach = f"approach{joint[1:]}"
        if approach in layout.columns:
            table[approach] = cells.numbers(approach)
    table["target"] = _read_targets(cells, options.target)
    return table | number_loads_and_repeats(cells, table)


def _read_joint_angles(
    cells: Cells, layout: PoseTable, robot: Robot | None
) -> tuple[np.ndarray, list[str]]:
    """Read joint angles (N, n), rad, within the limits of a robot if there is one, and
    sentences about those that were beyond."""
    joint_angles = cells.matrix(layout.angles)
    if robot is None:
        return joint_angles, []
    headers = [layout.columns[name] for name in layout.angles]
    return unwrap_into_limits(joint_angles, robot, headers)


def _read_optional_columns(
    layout: PoseTable,
    headers: Mapping[str, str],
    options: ImportOptions,
    rows: np.ndarray,
) -> _OptionalColumns:
    """Read time, temperature and uncertainty if they are there.

    A time or a temperature that cannot be read is left out with a note, unless an
    option asks for it. `headers`: those that options state, by name.
    """
    optional = _OptionalColumns({}, {}, [])
    for name in CONDITIONS:
        if name not in layout.columns:
            continue
        header = layout.columns[name]
        try:
            unit = find_units(
                layout.text,
                layout.columns,
                [name],
                layout.stated_units,
                options.units,
            )
            cells = layout.text.cells({name: header}, find_scales(unit), rows)
            if name == "time_s":
                values = read_times(cells)
                if find_times_of_day(cells.texts(name)):
                    note = f"{header!r} is a time of day: it counts from the midnight before"
                    optional.notes.append(note)
            else:
                values = cells.numbers(name)
        except InputError as error:
            if name in headers or name in options.units or name == "u95_m":
                raise InputError(
                    error.source,
                    error.key,
                    error.found,
                    f"{error.allowed}, or --ignore {header!r}",
                ) from None
            note = f"{header!r} not read: {error.key} has {error.found}"
            optional.notes.append(note)
        else:
            optional.columns[name] = values
            optional.units.update(unit)
    return optional


def _read_targets(cells: Cells, stated_name: str | None) -> np.ndarray:
    """Read the names of the targets (N,), or repeat the stated one."""
    if "target" in cells.columns:
        names = cells.texts("target")
        source = cells.path
        key = f"column {cells.headers['target']}"
    elif stated_name is not None:
        names = [stated_name] * len(cells.rows)
        source = "--target"
        key = ""
    else:
        raise InputError(
            cells.path,
            "header",
            "no column target",
            "--target NAME, the target of all rows, or --column target=NAME",
        )
    for name in dict.fromkeys(names):
        fault = find_text_fault(name)
        if fault:
            raise InputError(source, key, *fault)
    return np.array(names)
