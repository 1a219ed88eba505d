"""Files of measurements: their columns, read cell by cell with the row of every fault, and written."""

import csv
import itertools
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from elastocal.counting import counted
from elastocal.errors import InputError, closest_first, steering
from elastocal.io.atomic_writes import atomic_write
from elastocal.io.storage import Column
from elastocal.io.texts import A_NUMBER, LARGEST_NUMBER, plain_number
from elastocal.mechanics.components import WRENCH, WRENCH_NAMES

# A diagnosis of a million measurements takes ten minutes and 2 GB (docs, benchmarks); a tracker's stream is averaged before.
MOST_MEASUREMENTS = 2_000_000
_LONGEST_LINE, _MOST_BYTES = 10_000, 500 * MOST_MEASUREMENTS
_MOST_ROW_GROUPS = 2_000
# A file names no more.
MOST_JOINTS = 99

CSV, PARQUET = "measurements.csv", "measurements.parquet"
ROTATION = ("rx", "ry", "rz")
# Columns of a sheet for people: a place to tick, which is not read, and joint angles as controllers show them, q1_deg or q1_mm,
# with the SI value of one unit. They must agree with q1 .. qn to what is shown.
TICK = "done"
SHOWN = {"deg": math.radians(1.0), "mm": 1e-3}
SHOWN_TO = 2e-3


# A turn and a half, of a rotation vector; nor does a joint of a serial arm report more, unless its limits say so.
FARTHEST_RAD = 3.0 * np.pi
# Least and largest value of a column, in its unit, and why. Generous: whatever lies beyond is in another unit, or no reading of
# an instrument beside a robot.
_Bound = tuple[float, float, str]
_FORCE: _Bound = (-1e6, 1e6, "N, the weight of a hundred tonnes")
_MOMENT: _Bound = (-1e7, 1e7, "N m, a hundred tonnes on a lever of ten metres")
_PLACE: _Bound = (-2e7, 2e7, "m, half the circumference of the Earth")
BOUNDS: Mapping[str, _Bound] = {
    **dict.fromkeys(("fx", "fy", "fz"), _FORCE),
    **dict.fromkeys(("mx", "my", "mz"), _MOMENT),
    **dict.fromkeys("xyz", _PLACE),
    "time_s": (-1e11, 1e11, "s, three thousand years either way: not milliseconds of a calendar"),
    "temperature_c": (-200.0, 200.0, "°C, in which arms work, not kelvin"),
    "u95_m": (1e-8, 0.1, "m, more than 0: a sixtieth of a laser's wavelength at least, at most what a robot is off by"),
}


def file_columns(joints: int) -> dict[str, Column]:
    """Every column that a file of measurements may have."""
    numbers = range(1, joints + 1)
    columns = [
        Column("session", "int32", "", "sessions have each their own tracker frame; 0 throughout where absent"),
        Column("pose", "int32", "", "number of the pose in its session"),
        Column("load", "int32", "", "number of the load, 0 where unloaded"),
        Column("repeat", "int32", "", "number of the fresh approach to this pose and load"),
        Column("target", "string", "", "name of the target that was read"),
        *(Column(f"q{j}", "float64", "rad", f"angle of joint {j} as the controller reports it") for j in numbers),
        *(Column(name, "float64", unit, f"external {meaning}, at the last measuring point") for name, unit, meaning in WRENCH),
        *(Column(axis, "float64", "m", f"measured position along {axis}") for axis in "xyz"),
        *(Column(f"r{axis}", "float64", "rad", f"measured rotation vector about {axis}") for axis in "xyz"),
        *(Column(f"approach{j}", "float64", "", f"sense of approach of joint {j}: -1, 0, +1") for j in numbers),
        Column("time_s", "float64", "s", "time since any instant"),
        Column("temperature_c", "float64", "°C", "temperature"),
        Column("u95_m", "float64", "m", "expanded uncertainty of this position: 95 % of one coordinate"),
    ]
    return {column.name: column for column in columns}


def sheet_columns(joints: int) -> set[str]:
    """Names of the columns of a sheet for people, which a file of measurements may have beside `file_columns`."""
    return {TICK, *(f"q{j}_{unit}" for j in range(1, joints + 1) for unit in SHOWN)}


@dataclass(frozen=True)
class Cells:
    """Columns of a table by name, as numbers in SI units or as texts; an `InputError` names the place of what is neither.

    `columns`: cells as they stand in the file. `rows` (N,): number of each row in the file, 1 for the first of data.
    `header_line`: line of the header, 0 where `rows` has lines, None where the file is no text. `headers`: what the file calls
    columns, if otherwise. `scales`: SI values of their units, if not 1.
    """

    path: str
    columns: Mapping[str, pa.ChunkedArray]
    rows: np.ndarray
    header_line: int | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)

    def fault(self, index: int, name: str, allowed: str, found: str | None = None) -> InputError:
        """InputError of one cell, or without `name` of a row; `index` counts the rows."""
        return InputError(
            self.path,
            f"{self.place(index)}{f', column {self.headers.get(name, name)}' if name else ''}",
            _show(self.columns[name][index].as_py()) if found is None else found,
            allowed,
        )

    def place(self, index: int) -> str:
        """Where a row stands in the file."""
        row = int(self.rows[index])
        return f"row {row}" if self.header_line is None else f"line {row + self.header_line}"

    def numbers(self, name: str) -> np.ndarray:
        """ndarray (N,) of finite numbers."""
        try:
            values = self.columns[name].cast(pa.float64()).to_numpy()
        except pa.ArrowInvalid:
            # A cell is none, or written as a spreadsheet does.
            found = [plain_number(str(cell)) for cell in self.columns[name].to_pylist()]
            if None in found:
                raise self.fault(found.index(None), name, A_NUMBER) from None
            values = np.array(found, float)
        # Not a number is no more than anything either.
        sound = np.abs(values) <= LARGEST_NUMBER
        if not sound.all():
            raise self.fault(int(np.argmin(sound)), name, A_NUMBER)
        return self.bounded(name, values * self.scales.get(name, 1.0))

    def bounded(self, name: str, values: np.ndarray) -> np.ndarray:
        """The same values (N,) of a column, all of which physics allows."""
        least, largest, why = BOUNDS.get(name, (-np.inf, np.inf, ""))
        wrong = ~((values >= least) & (values <= largest))
        if wrong.any():
            raise self.fault(int(np.argmax(wrong)), name, f"{least:g} to {largest:g} {why}")
        return values

    def matrix(self, names: Iterable[str]) -> np.ndarray:
        """ndarray (N, len(names)) of finite numbers."""
        return np.column_stack([self.numbers(name) for name in names])

    def integers(self, name: str) -> np.ndarray:
        """ndarray of int32 (N,)."""
        values = self.numbers(name)
        wrong = (values != np.round(values)) | (np.abs(values) >= 2**31)
        if wrong.any():
            raise self.fault(int(np.argmax(wrong)), name, f"an integer, up to {2**31 - 1}")
        return values.astype(np.int32)

    def texts(self, name: str) -> list[str]:
        """list of str (N,)."""
        column = self.columns[name]
        encoded = column if pa.types.is_dictionary(column.type) else column.cast(pa.string()).dictionary_encode()
        whole = encoded.unify_dictionaries().combine_chunks()
        words = [str(word).strip() for word in whole.dictionary.to_pylist()]
        return ["" if code is None else words[code] for code in whole.indices.to_pylist()]


def _show(cell: Any) -> str:
    text = "" if cell is None else str(cell).strip().removesuffix(".0")
    return repr(text[:40]) if text else "nothing"


def read_measurements(folder: Path, joints: int, measured: str) -> Cells:
    """The measurements of a campaign, with all columns that it needs.

    `folder`: holds either `CSV` or `PARQUET`. `measured`: one of "position", "pose". Raises `InputError`: no file or two, a
    file that cannot be read, a column that is missing, unknown or there twice, a row of another length, more than
    `MOST_MEASUREMENTS` rows, or angles that are others than those shown beside.
    """
    there = [path for path in (folder / CSV, folder / PARQUET) if path.is_file()]
    if len(there) != 1:
        found = "both" if there else "neither"
        raise InputError(folder.as_posix(), "", f"{found} {CSV} {'and' if there else 'nor'} {PARQUET}", "one of them")
    table, known = _read(there[0], joints), file_columns(joints)
    if len(table.rows) == 0:
        raise InputError(there[0], "", "no row of data", "one row for each measurement of one target")
    angles, approach = ([f"{letter}{j}" for j in range(1, joints + 1)] for letter in ("q", "approach"))
    required = ["pose", "load", "repeat", "target", *angles, "x", "y", "z", *(ROTATION if measured == "pose" else ())]
    for group in (WRENCH_NAMES, approach):
        required += group if any(name in table.columns for name in group) else []
    for name in required:
        if name not in table.columns:
            unit = f" in {known[name].unit}" if known[name].unit else ""
            raise InputError(table.path, "header", f"no column {name!r}", f"{name}: {known[name].meaning}{unit}")
    for name, unit in itertools.product(angles, SHOWN):
        if (beside := f"{name}_{unit}") in table.columns:
            values = table.numbers(name) / SHOWN[unit]
            wrong = np.abs(values - table.numbers(beside)) > SHOWN_TO
            if wrong.any():
                index = int(np.argmax(wrong))
                allowed = f"{values[index]:.3f}, which is {name}, or a file without the column {beside}"
                raise table.fault(index, beside, allowed)
    return table


def described_by(folder: Path) -> tuple[list[str], str]:
    """Targets that the measurements of a folder are of, in their order, and whether each is a "position" or a "pose".

    No targets where there is no measurement. Raises `InputError`: a file that is no table of measurements.
    """
    there = next((path for path in (folder / CSV, folder / PARQUET) if path.is_file()), None)
    if there is None:
        return [], "position"
    table = _read(there, MOST_JOINTS)
    names = dict.fromkeys(name for name in (table.texts("target") if "target" in table.columns else ()) if name)
    return list(names), "pose" if {*ROTATION} <= table.columns.keys() else "position"


def check_column_names(names: Collection[str], joints: int, path: str) -> None:
    """Refuse a column that the format does not have, or that is there twice.

    `path`: named in errors. Raises `InputError`: the first such column.
    """
    known, beside = file_columns(joints), sheet_columns(joints)
    if twice := next((name for place, name in enumerate(names) if name in [*names][:place]), None):
        raise InputError(path, "header", f"column {twice!r} twice", "each column once")
    for name in names:
        if name not in known and name not in beside:
            # That q7 is unknown helps little where it is not stated how many joints the robot has.
            of = f", for {joints} joints" if name.rstrip("0123456789") in ("q", "approach") else ""
            missing = [other for other in known if other not in names]
            raise InputError(path, "header", f"the unknown column {name!r}", closest_first(name, missing) + of)


def write_measurements(path: str | Path, table: Mapping[str, Sequence[Any] | np.ndarray], joints: int) -> None:
    """Write the measurements of a campaign.

    `path`: holds CSV where its name is `CSV`, else Parquet. `table`: columns of one length, named as in `file_columns`.
    """
    columns = [column for name, column in file_columns(joints).items() if name in table]
    with atomic_write(path) as partial:
        (_write_csv if Path(path).name == CSV else _write_parquet)(partial, columns, table)


def _read(path: Path, joints: int) -> Cells:
    source = path.as_posix()
    if (size := path.stat().st_size) > _MOST_BYTES:
        allowed = f"at most {_MOST_BYTES}, which hold {MOST_MEASUREMENTS} measurements"
        raise InputError(source, "", counted(size, "byte"), allowed)
    table = _read_csv(source, joints) if path.name == CSV else _read_parquet(source, joints)
    if len(table.rows) > MOST_MEASUREMENTS:
        raise _refuse_length(source, len(table.rows))
    return table


def _read_csv(path: str, joints: int) -> Cells:
    """Columns of texts, of the rows that are not blank."""
    header_line, header = _scan(path)
    if not header:
        raise InputError(path, "", "an empty file", "a header and one row for each measurement of one target")
    names = [cell.strip() for cell in next(csv.reader([header], skipinitialspace=True))]
    if len(names) == 1 and any(separator in names[0] for separator in ";\t"):
        raise InputError(path, "header", repr(names[0][:40]), "columns separated by commas, decimals by a point")
    check_column_names(names, joints, path)
    other: list[pyarrow.csv.InvalidRow] = []

    def leave_out(row: pyarrow.csv.InvalidRow) -> str:
        other.append(row)
        return "skip"

    try:
        table = pyarrow.csv.read_csv(
            path,
            # Without threads rows of another length come with the number of their line.
            pyarrow.csv.ReadOptions(use_threads=False, skip_rows=header_line, column_names=names),
            pyarrow.csv.ParseOptions(ignore_empty_lines=False, invalid_row_handler=leave_out),
            pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=False),
        )
    except pa.ArrowInvalid as error:
        # A header is all that there is.
        if "Empty CSV file" not in str(error):
            raise InputError(path, "", str(error), "comma-separated values, quotes in pairs") from None
        table = pa.table({name: pa.array([], pa.string()) for name in names})
    if wrong := next((row for row in other if row.text.replace(",", "").strip()), None):
        allowed = f"{len(names)}, one for each column of the header"
        raise InputError(path, f"line {wrong.number}", counted(wrong.actual_columns, "cell"), allowed)
    table = pa.table({name: pc.utf8_trim_whitespace(table[name]) for name in names})
    filled = np.any([pc.not_equal(column, "").to_numpy() for column in table.columns], axis=0)
    rows = np.setdiff1d(np.arange(1, table.num_rows + len(other) + 1), [row.number - header_line for row in other])
    table = table.filter(pa.array(filled))
    return Cells(path, dict(zip(names, table.columns, strict=True)), rows[filled].astype(np.int32), header_line)


def _scan(path: str) -> tuple[int, str]:
    """Number and text of the line that is the header; a line that no table of measurements has is refused."""
    header, text = 0, ""
    # A byte order mark is what spreadsheets write. Bytes that are no UTF-8 become what is refused with the line.
    with open(path, encoding="utf-8-sig", errors="surrogateescape", newline="") as file:
        for number, line in enumerate(iter(lambda: file.readline(_LONGEST_LINE), ""), 1):
            where = f"line {number}"
            if len(line) == _LONGEST_LINE:
                raise InputError(path, where, f"{_LONGEST_LINE} characters or more", "one measurement in a line")
            if not line.isascii() and any("\ud800" <= character <= "\udfff" for character in line):
                raise InputError(path, where, "text that is not UTF-8", "a UTF-8 file")
            if character := steering(line.rstrip("\r\n").replace("\t", " ")):
                raise InputError(path, where, f"the character {character!a}", "printable characters")
            if header and line.count('"') % 2:
                raise InputError(path, where, "a quote that is not closed", "comma-separated values, quotes in pairs")
            if not header and line.strip() and not line.lstrip().startswith("#"):
                header, text = number, line
    return header, text


def _read_parquet(path: str, joints: int) -> Cells:
    texts = {TICK, *(name for name, column in file_columns(joints).items() if column.type == "string")}
    try:
        # pyarrow's own complaint of a column that is there twice is a list of all columns.
        with pq.ParquetFile(path) as file:
            fields, count, groups = file.schema_arrow, file.metadata.num_rows, file.metadata.num_row_groups
        check_column_names(fields.names, joints, path)
        # A kilobyte may hold a list of a billion numbers; each row group takes memory of its own beside its rows.
        for field in fields:
            kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
            is_number = pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind)
            if not (is_number or (pa.types.is_string(kind) and field.name in texts)):
                allowed = "numbers, or text" if field.name in texts else "numbers"
                raise InputError(path, f"column {field.name}", f"type {field.type}", allowed)
        if groups > _MOST_ROW_GROUPS:
            raise InputError(path, "", f"{groups} row groups", f"at most {_MOST_ROW_GROUPS}")
        if count > MOST_MEASUREMENTS:
            raise _refuse_length(path, count)
        # As dictionaries texts take the memory that they take in the file.
        there = [name for name in fields.names if name in texts]
        table = pq.read_table(path, read_dictionary=there, page_checksum_verification=True, partitioning=None)
        table.validate(full=True)
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise InputError(path, "", f"no readable Parquet file ({error})", "a Parquet file") from None
    columns = dict(zip(table.column_names, table.columns, strict=True))
    return Cells(path, columns, np.arange(1, table.num_rows + 1, dtype=np.int32))


def _refuse_length(path: str, found: int) -> InputError:
    allowed = f"at most {MOST_MEASUREMENTS} (the mean of a tracker's stream at each pose is one measurement)"
    return InputError(path, "", f"{found} rows of data", allowed)


def _write_csv(path: str, columns: Iterable[Column], table: Mapping[str, Sequence[Any] | np.ndarray]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        # repr of a float is the shortest text that reads back as the same number.
        writer.writerows(zip(*(np.asarray(table[column.name]).tolist() for column in columns), strict=True))


def _write_parquet(path: str, columns: Iterable[Column], table: Mapping[str, Sequence[Any] | np.ndarray]) -> None:
    fields = [pa.field(c.name, pa.type_for_alias(c.type), False, {"unit": c.unit, "meaning": c.meaning}) for c in columns]
    arrays = [pa.array(np.asarray(table[field.name]).tolist(), field.type) for field in fields]
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path, compression="zstd", write_page_checksum=True)
