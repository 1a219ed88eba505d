"""Files of measurements: their columns, read cell by cell with the row of every fault,
and written."""

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
from elastocal.io.atomic_writes import atomic_write
from elastocal.io.storage import Column
from elastocal.io.texts import describe_file_kind
from elastocal.mechanics.components import WRENCH, WRENCH_NAMES

# A diagnosis of a million measurements takes 2 GB (benchmarks); a tracker's stream is
# averaged before.
MOST_MEASUREMENTS = 2_000_000
_MOST_BYTES = 500 * MOST_MEASUREMENTS
_MOST_ROW_GROUPS = 2_000
# A file names no more.
MOST_JOINTS = 99

CSV = "measurements.csv"
PARQUET = "measurements.parquet"
ROTATION = ("rx", "ry", "rz")
# Columns of a sheet for people: a place to tick, which is not read, and joint angles as
# controllers show them, q1_deg or q1_mm, with the SI value of one unit. They must agree
# with q1 .. qn to what is shown.
TICK_COLUMN = "done"
DISPLAY_UNITS = {"deg": math.radians(1.0), "mm": 1e-3}
DISPLAY_TOLERANCE = 2e-3

# A turn and a half, of a rotation vector; nor does a joint of a serial arm report more,
# unless its limits say so.
LARGEST_ROTATION_RAD = 3.0 * np.pi


def describe_columns(joints: int) -> dict[str, Column]:
    """Every column that a file of measurements may have."""
    numbers = range(1, joints + 1)
    columns = [
        Column(
            "session",
            "int32",
            "",
            "sessions have each their own tracker frame; 0 throughout where absent",
        ),
        Column("pose", "int32", "", "number of the pose in its session"),
        Column("load", "int32", "", "number of the load, 0 where unloaded"),
        Column(
            "repeat", "int32", "", "number of the fresh approach to this pose and load"
        ),
        Column("target", "string", "", "name of the target that was read"),
        *(
            Column(
                f"q{j}",
                "float64",
                "rad",
                f"angle of joint {j} as the controller reports it",
            )
            for j in numbers
        ),
        *(
            Column(
                name,
                "float64",
                unit,
                f"external {meaning}, at the last measuring point",
            )
            for name, unit, meaning in WRENCH
        ),
        *(
            Column(axis, "float64", "m", f"measured position along {axis}")
            for axis in "xyz"
        ),
        *(
            Column(
                f"r{axis}", "float64", "rad", f"measured rotation vector about {axis}"
            )
            for axis in "xyz"
        ),
        *(
            Column(
                f"approach{j}",
                "float64",
                "",
                f"sense of approach of joint {j}: -1, 0, +1",
            )
            for j in numbers
        ),
        Column("time_s", "float64", "s", "time since any instant"),
        Column("temperature_c", "float64", "°C", "temperature"),
        Column(
            "u95_m",
            "float64",
            "m",
            "expanded uncertainty of this position: 95 % of one coordinate",
        ),
    ]
    return {column.name: column for column in columns}


def is_file(path: str | Path) -> bool:
    """Whether a path is that of a regular file; False too for what no path can be."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        # A name that is too long, or with a null character.
        return False


def is_file_in(path: str | Path, *folders: str | Path) -> bool:
    """Whether a path is that of a regular file in or below one of some folders; links
    are followed, on both sides."""
    return is_file(path) and any(
        Path(path).resolve().is_relative_to(Path(folder).resolve())
        for folder in folders
    )


def find_files(folder: str | Path, *names: str) -> list[Path]:
    """Files of these names in a folder; a link out of it, a pipe and the like are
    refused."""
    there = [path for name in names if os.path.lexists(path := Path(folder) / name)]
    for path in there:
        if not is_file(path):
            raise InputError(
                path,
                "",
                f"{describe_file_kind(os.lstat(path).st_mode)} that leads to no file",
                "the file itself",
            )
        if not is_file_in(path, folder):
            raise InputError(
                path, "", "a link out of the campaign's folder", "the file itself"
            )
    return there


def read_measurements(folder: Path, joints: int, measured: str) -> Cells:
    """The measurements of a campaign, with all columns that it needs.

    `folder`: holds either `CSV` or `PARQUET`. `measured`: one of "position", "pose".
    Raises `InputError`: no file or two, a file that cannot be read, a column that is
    missing, unknown or there twice, a row of another length, more than
    `MOST_MEASUREMENTS` rows, or angles that are others than those shown beside.
    """
    there = find_files(folder, CSV, PARQUET)
    if len(there) != 1:
        found = f"both {CSV} and {PARQUET}" if there else f"neither {CSV} nor {PARQUET}"
        raise InputError(folder.as_posix(), "", found, "one of them")
    table = _read(there[0], joints)
    known = describe_columns(joints)
    if len(table.rows) == 0:
        raise InputError(
            there[0], "", "no row of data", "one row for each measurement of one target"
        )
    angles, approach = (
        [f"{letter}{j}" for j in range(1, joints + 1)] for letter in ("q", "approach")
    )
    required = [
        "pose",
        "load",
        "repeat",
        "target",
        *angles,
        "x",
        "y",
        "z",
        *(ROTATION if measured == "pose" else ()),
    ]
    required += [
        name
        for group in (WRENCH_NAMES, approach)
        if {*group} & table.columns.keys()
        for name in group
    ]
    if missing := next((name for name in required if name not in table.columns), None):
        unit = f" in {known[missing].unit}" if known[missing].unit else ""
        raise InputError(
            table.path,
            "header",
            f"no column {missing!r}",
            f"{missing}: {known[missing].meaning}{unit}",
        )
    for name, unit in itertools.product(angles, DISPLAY_UNITS):
        if (beside := f"{name}_{unit}") in table.columns:
            wrong = (
                np.abs(
                    table.numbers(name) / DISPLAY_UNITS[unit] - table.numbers(beside)
                )
                > DISPLAY_TOLERANCE
            )
            table.refuse(
                wrong,
                [beside],
                f"what is {name} in {unit}, or a file without the column {beside}",
            )
    return table


def read_measured_targets(folder: Path) -> tuple[list[str], str]:
    """Targets that the measurements of a folder are of, in their order, and whether
    each is a "position" or a "pose".

    No targets where there is no measurement. Raises `InputError`: a file that is no
    table of measurements.
    """
    try:
        table = next(
            (_read(path, MOST_JOINTS) for path in find_files(folder, CSV, PARQUET)),
            None,
        )
    except InputError as error:
        if error.found != HEADER_WITHOUT_ROWS:
            raise
        table = None
    if table is None:
        return [], "position"
    names = dict.fromkeys(
        name
        for name in (table.texts("target") if "target" in table.columns else ())
        if name
    )
    return list(names), "pose" if {*ROTATION} <= table.columns.keys() else "position"


def check_column_names(names: Collection[str], joints: int, path: str) -> None:
    """Refuse the first column that is there twice, or that neither the format nor a
    sheet has; `path` is named in errors."""
    known = describe_columns(joints)
    allowed = {
        *known,
        TICK_COLUMN,
        *(f"q{j}_{unit}" for j in range(1, joints + 1) for unit in DISPLAY_UNITS),
    }
    if twice := next(
        (name for place, name in enumerate(names) if name in [*names][:place]), None
    ):
        raise InputError(path, "header", f"column {twice!r} twice", "each column once")
    if name := next((name for name in names if name not in allowed), None):
        # That q7 is unknown helps little where it is not stated how many joints the
        # robot has.
        of = (
            f", for {joints} joints"
            if name.rstrip("0123456789") in ("q", "approach")
            else ""
        )
        missing = [other for other in known if other not in names]
        raise InputError(
            path,
            "header",
            f"the unknown column {name!r}",
            suggest_names(name, missing) + of,
        )


def write_measurements(
    path: str | Path, table: Mapping[str, Sequence[Any] | np.ndarray], joints: int
) -> None:
    """Write the measurements of a campaign.

    `path`: holds CSV where its name is `CSV`, else Parquet. `table`: columns of one
    length, named as in `describe_columns`.
    """
    columns = [
        column for name, column in describe_columns(joints).items() if name in table
    ]
    cells = [np.asarray(table[column.name]).tolist() for column in columns]
    with atomic_write(path) as partial:
        if Path(path).name == CSV:
            with open(partial, "w", encoding="utf-8", newline="") as file:
                # repr of a float is the shortest text that reads back as the same
                # number.
                rows = zip(*cells, strict=True)
                csv.writer(file, lineterminator="\n").writerows(
                    itertools.chain([[column.name for column in columns]], rows)
                )
            return
        schema = [
            pa.field(
                c.name,
                pa.type_for_alias(c.type),
                False,
                {"unit": c.unit, "meaning": c.meaning},
            )
            for c in columns
        ]
        arrays = [
            pa.array(values, field.type)
            for values, field in zip(cells, schema, strict=True)
        ]
        whole = pa.Table.from_arrays(arrays, schema=pa.schema(schema))
        pq.write_table(whole, partial, compression="zstd", write_page_checksum=True)


def _read(path: Path, joints: int) -> Cells:
    return (_read_csv if path.name == CSV else _read_parquet)(path.as_posix(), joints)


def _read_csv(path: str, joints: int) -> Cells:
    text = read_text_table(
        path,
        lambda cells: "pose" in cells,
        wanted="a header with pose, load, repeat, target, q1 and so on",
    )
    check_column_names(text.columns, joints, path)
    table = text.cells({name: name for name in text.columns}, {})
    header = text.dialect.header or 0
    return replace(
        table, rows=(table.rows - header).astype(np.int32), header_line=header
    )


def _read_parquet(path: str, joints: int) -> Cells:
    texts = {
        TICK_COLUMN,
        *(
            name
            for name, column in describe_columns(joints).items()
            if column.type == "string"
        ),
    }
    if (size := os.path.getsize(path)) > _MOST_BYTES:
        raise InputError(
            path,
            "",
            format_count(size, "byte"),
            f"at most {_MOST_BYTES}, which hold {MOST_MEASUREMENTS} measurements",
        )
    try:
        # pyarrow's own complaint of a column that is there twice is a list of all
        # columns.
        with pq.ParquetFile(path) as file:
            fields = file.schema_arrow
            count = file.metadata.num_rows
            groups = file.metadata.num_row_groups
        check_column_names(fields.names, joints, path)
        # A kilobyte may hold a list of a billion numbers; each row group takes memory
        # of its own beside its rows.
        for field in fields:
            kind = field.type
            is_number = (
                pa.types.is_floating(kind)
                or pa.types.is_integer(kind)
                or pa.types.is_null(kind)
            )
            word = kind.value_type if pa.types.is_dictionary(kind) else kind
            if not (is_number or (pa.types.is_string(word) and field.name in texts)):
                allowed = "numbers, or text" if field.name in texts else "numbers"
                raise InputError(
                    path, f"column {field.name}", f"type {field.type}", allowed
                )
        for number, what, most in (
            (groups, "row groups", _MOST_ROW_GROUPS),
            (count, "rows of data", MOST_MEASUREMENTS),
        ):
            if number > most:
                raise InputError(path, "", f"{number} {what}", f"at most {most}")
        # As dictionaries texts take the memory that they take in the file.
        there = [name for name in fields.names if name in texts]
        table = pq.read_table(
            path,
            read_dictionary=there,
            page_checksum_verification=True,
            partitioning=None,
        )
        table.validate(full=True)
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise InputError(
            path, "", f"no readable Parquet file ({error})", "a Parquet file"
        ) from None
    columns = dict(zip(table.column_names, table.columns, strict=True))
    return Cells(path, columns, np.arange(1, table.num_rows + 1, dtype=np.int32))
