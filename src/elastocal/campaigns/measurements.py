"""Read and write files of measurements, as CSV or Parquet. Each fault is reported with
its row and column."""

import csv
import itertools
import math
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from elastocal.campaigns.tables import HEADER_WITHOUT_ROWS, Cells, read_text_table
from elastocal.counting import format_count
from elastocal.errors import InputError, suggest_names
from elastocal.io.atomic_writes import write_atomically
from elastocal.io.storage import Column, read_schemas
from elastocal.io.texts import describe_file_kind
from elastocal.mechanics.components import WRENCH_NAMES, list_joint_columns

# Upper bounds on a file. The diagnosis of a million measurements takes 2 GB (see
# benchmarks); a tracker's stream is averaged before it is written to a file.
MOST_MEASUREMENTS = 2_000_000
_MOST_BYTES = 500 * MOST_MEASUREMENTS
# Each row group takes memory of its own.
_MOST_ROW_GROUPS = 2_000
# Upper bound on the number of joints for which a file has columns.
MOST_JOINTS = 99

CSV = "measurements.csv"
PARQUET = "measurements.parquet"
# Columns that a campaign can do without.
CONDITIONS = ("time_s", "temperature_c", "u95_m")
POSITION = ("x", "y", "z")
ROTATION = ("rx", "ry", "rz")
# A sheet for people has more columns. One is to be ticked and is not read.
TICK_COLUMN = "done"
# The others are joint angles as controllers display them, such as q1_deg or q1_mm. Here
# is the SI value of each unit. The angles must agree with q1 .. qn to the tolerance, in
# the displayed unit.
DISPLAY_UNITS = {"deg": math.radians(1.0), "mm": 1e-3}
DISPLAY_TOLERANCE = 2e-3
# A turn and a half. No rotation vector is longer, and no joint of a serial arm reports
# more, unless its limits are wider.
LARGEST_ROTATION_RAD = 3.0 * np.pi
_SCHEMA = read_schemas(__file__)["measurements"]


def describe_columns(joints: int) -> dict[str, Column]:
    """Return every column that a file of measurements may have, by its name."""
    columns = _SCHEMA.for_joints(joints).columns
    return {column.name: column for column in columns}


def is_file(path: str | Path) -> bool:
    """Return whether a path is that of a regular file; False also for an impossible
    path."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        # The name is too long or has a null character.
        return False


def is_file_in(path: str | Path, *folders: str | Path) -> bool:
    """Return whether a path is that of a regular file in or below one of the folders.
    Links are followed, in the path and in the folders."""
    return is_file(path) and any(
        Path(path).resolve().is_relative_to(Path(folder).resolve())
        for folder in folders
    )


def find_files(folder: str | Path, *names: str) -> list[Path]:
    """Find the files of these names in a folder.

    An `InputError` refuses a link out of the folder, a pipe and anything else that is
    not a regular file.
    """
    candidates = [Path(folder) / name for name in names]
    paths = [path for path in candidates if os.path.lexists(path)]
    for path in paths:
        if not is_file(path):
            kind = describe_file_kind(os.lstat(path).st_mode)
            raise InputError(
                path, "", f"{kind} that leads to no file", "the file itself"
            )
        if not is_file_in(path, folder):
            finding = "a link out of the campaign's folder"
            raise InputError(path, "", finding, "the file itself")
    return paths


def read_measurements(folder: Path, joints: int, numbers: Sequence[str]) -> Cells:
    """Read the measurements of a campaign, with all columns that it needs.

    Parameters
    ----------
    folder : folder with either `CSV` or `PARQUET`.
    joints : number of joints of the robot.
    numbers : columns with what was measured, such as `POSITION`.

    Raises
    ------
    InputError
        If there is no file or both; if the file cannot be read; if a column is missing,
        unknown or there twice; if a row has another length; if there are more than
        `MOST_MEASUREMENTS` rows; or if displayed angles differ from the others.
    """
    paths = find_files(folder, CSV, PARQUET)
    if len(paths) != 1:
        finding = (
            f"both {CSV} and {PARQUET}" if paths else f"neither {CSV} nor {PARQUET}"
        )
        raise InputError(folder.as_posix(), "", finding, "one of them")
    table = _read(paths[0], joints)
    if len(table.rows) == 0:
        allowed = "one row for each measurement of one target"
        raise InputError(paths[0], "", "no row of data", allowed)
    _check_required_columns(table, joints, numbers)
    _check_displayed_angles(table, joints)
    return table


def _check_required_columns(table: Cells, joints: int, measured: Sequence[str]) -> None:
    """Refuse a table that lacks a column, or some of the columns of wrench or approach."""
    present = table.columns.keys()
    approach = list_joint_columns(joints, "approach")
    required = ["pose", "load", "repeat", "target"]
    required += list_joint_columns(joints)
    required += measured
    for optional in (WRENCH_NAMES, approach):
        if present & {*optional}:
            required += optional
    missing = next((name for name in required if name not in present), None)
    if missing is not None:
        column = describe_columns(joints)[missing]
        unit = f" in {column.unit}" if column.unit else ""
        raise InputError(
            table.path,
            "header",
            f"no column {missing!r}",
            f"{missing}: {column.meaning}{unit}",
        )


def _check_displayed_angles(table: Cells, joints: int) -> None:
    """Refuse an angle in a displayed unit that differs from the angle in rad."""
    for joint, unit in itertools.product(range(1, joints + 1), DISPLAY_UNITS):
        name = f"q{joint}"
        displayed = f"{name}_{unit}"
        if displayed in table.columns:
            expected = table.numbers(name) / DISPLAY_UNITS[unit]
            wrong = np.abs(expected - table.numbers(displayed)) > DISPLAY_TOLERANCE
            allowed = (
                f"what is {name} in {unit}, or a file without the column {displayed}"
            )
            table.refuse(wrong, [displayed], allowed)


def read_all_columns(path: Path) -> dict[str, np.ndarray]:
    """Read every column of the format that a file of measurements has, with however many
    joints."""
    table = _read(path, MOST_JOINTS)
    return {
        name: convert_column(table, column)
        for name, column in describe_columns(MOST_JOINTS).items()
        if name in table.columns
    }


def convert_column(table: Cells, column: Column) -> np.ndarray:
    """Convert a column (N,) of a table to texts, integers or numbers, as the format has
    it."""
    if column.type == "string":
        return np.array(table.texts(column.name))
    if column.type == "int32":
        return table.integers(column.name)
    return table.numbers(column.name)


def name_joint_columns(angles: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of joint angles (N, n) by their names."""
    return dict(zip(list_joint_columns(angles.shape[1]), angles.T, strict=True))


def tabulate_single_measurements(
    angles: np.ndarray, target: str
) -> dict[str, np.ndarray]:
    """Tabulate poses of the unloaded robot in which one target was measured once.

    Returns the columns of the state and the target, one row for each pose, with joint
    angles (N, n) as the controller reports them.
    """
    pose = np.arange(len(angles))
    return {
        "pose": pose,
        "load": np.zeros_like(pose),
        "repeat": np.zeros_like(pose),
        "target": np.full(len(pose), target),
        **name_joint_columns(angles),
    }


def read_measured_targets(folder: Path) -> tuple[list[str], str]:
    """Read which targets the measurements of a folder are of.

    Returns
    -------
    targets : names in the order of the file; empty if there is no measurement.
    measured : "position" or "pose".

    Raises
    ------
    InputError
        If a file is not a table of measurements.
    """
    paths = find_files(folder, CSV, PARQUET)
    if not paths:
        return [], "position"
    try:
        table = _read(paths[0], MOST_JOINTS)
    except InputError as error:
        if error.found == HEADER_WITHOUT_ROWS:
            return [], "position"
        raise
    texts = table.texts("target") if "target" in table.columns else []
    targets = [name for name in dict.fromkeys(texts) if name]
    has_rotation = table.columns.keys() >= {*ROTATION}
    return targets, "pose" if has_rotation else "position"


def check_column_names(names: Collection[str], joints: int, path: str) -> None:
    """Refuse the first column that is there twice, or that neither the format nor a
    sheet has.

    Parameters
    ----------
    names : columns in the order of the file.
    joints : number of joints of the robot.
    path : file, for messages.
    """
    columns = describe_columns(joints)
    displayed = {
        f"q{joint}_{unit}" for joint in range(1, joints + 1) for unit in DISPLAY_UNITS
    }
    earlier = set()
    for name in names:
        if name in earlier:
            finding = f"column {name!r} twice"
            raise InputError(path, "header", finding, "each column once")
        earlier.add(name)
    for name in names:
        if name not in columns and name not in displayed and name != TICK_COLUMN:
            missing = [column for column in columns if column not in names]
            allowed = suggest_names(name, missing)
            if name.rstrip("0123456789") in ("q", "approach"):
                # An unknown q7 is puzzling unless the message has the number of joints.
                allowed += f", for {joints} joints"
            raise InputError(path, "header", f"the unknown column {name!r}", allowed)


def write_measurements(
    path: str | Path, table: Mapping[str, Sequence[Any] | np.ndarray], joints: int
) -> None:
    """Write the measurements of a campaign.

    Parameters
    ----------
    path : file; CSV if its name is `CSV`, else Parquet.
    table : columns of one length, named as in `describe_columns`.
    joints : number of joints of the robot.
    """
    columns = [
        column for name, column in describe_columns(joints).items() if name in table
    ]
    cells = [np.asarray(table[column.name]).tolist() for column in columns]
    with write_atomically(path) as partial:
        if Path(path).name == CSV:
            _write_csv(partial, columns, cells)
        else:
            _write_parquet(partial, columns, cells)


def _write_csv(
    path: str, columns: Sequence[Column], cells: Sequence[Sequence[Any]]
) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        # The writer uses repr, the shortest text that is read back as the same number.
        writer.writerows(zip(*cells, strict=True))


def _write_parquet(
    path: str, columns: Sequence[Column], cells: Sequence[Sequence[Any]]
) -> None:
    fields = [
        pa.field(
            column.name,
            pa.type_for_alias(column.type),
            nullable=False,
            metadata={"unit": column.unit, "meaning": column.meaning},
        )
        for column in columns
    ]
    arrays = [
        pa.array(values, field.type)
        for values, field in zip(cells, fields, strict=True)
    ]
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    pq.write_table(table, path, compression="zstd", write_page_checksum=True)


def _read(path: Path, joints: int) -> Cells:
    if path.name == CSV:
        return _read_csv(path.as_posix(), joints)
    return _read_parquet(path.as_posix(), joints)


def _read_csv(path: str, joints: int) -> Cells:
    text = read_text_table(
        path,
        lambda cells: "pose" in cells,
        wanted="a header with pose, load, repeat, target, q1 and so on",
    )
    check_column_names(text.columns, joints, path)
    table = text.cells({name: name for name in text.columns}, {})
    header = text.dialect.header or 0
    rows = (table.rows - header).astype(np.int32)
    return replace(table, rows=rows, header_line=header)


def _read_parquet(path: str, joints: int) -> Cells:
    """Read a Parquet file after its metadata have shown that it is of bounded size."""
    size = os.path.getsize(path)
    if size > _MOST_BYTES:
        allowed = f"at most {_MOST_BYTES}, which hold {MOST_MEASUREMENTS} measurements"
        raise InputError(path, "", format_count(size, "byte"), allowed)
    text_names = {TICK_COLUMN}
    for name, column in describe_columns(joints).items():
        if column.type == "string":
            text_names.add(name)
    try:
        with pq.ParquetFile(path) as file:
            fields = file.schema_arrow
            metadata = file.metadata
        # pyarrow's own complaint of a column that is there twice lists all columns.
        check_column_names(fields.names, joints, path)
        for field in fields:
            _check_type(field, text_names, path)
        _check_at_most(metadata.num_row_groups, "row groups", _MOST_ROW_GROUPS, path)
        _check_at_most(metadata.num_rows, "rows of data", MOST_MEASUREMENTS, path)
        table = pq.read_table(
            path,
            # Read as dictionaries, texts take no more memory than in the file.
            read_dictionary=[name for name in fields.names if name in text_names],
            page_checksum_verification=True,
            partitioning=None,
        )
        table.validate(full=True)
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        finding = f"no readable Parquet file ({error})"
        raise InputError(path, "", finding, "a Parquet file") from None
    columns = dict(zip(table.column_names, table.columns, strict=True))
    return Cells(path, columns, np.arange(1, table.num_rows + 1, dtype=np.int32))


def _check_type(field: pa.Field, text_names: Collection[str], path: str) -> None:
    """Refuse a column of anything but numbers, or texts where they belong. A kilobyte
    may hold a list of a billion numbers."""
    kind = field.type
    is_number = (
        pa.types.is_floating(kind)
        or pa.types.is_integer(kind)
        or pa.types.is_null(kind)
    )
    text_kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    may_be_text = field.name in text_names
    is_text = may_be_text and pa.types.is_string(text_kind)
    if not is_number and not is_text:
        allowed = "numbers, or text" if may_be_text else "numbers"
        raise InputError(path, f"column {field.name}", f"type {kind}", allowed)


def _check_at_most(count: int, noun: str, largest: int, path: str) -> None:
    if count > largest:
        raise InputError(path, "", f"{count} {noun}", f"at most {largest}")
