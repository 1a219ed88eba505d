"""Files of measurements: their columns, read cell by cell with the row of every fault, and written."""

from __future__ import annotations

import csv
import difflib
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from elastocal.errors import InputError
from elastocal.io.storage import Column
from elastocal.mechanics.components import WRENCH

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence
    from typing import Any

CSV, PARQUET = "measurements.csv", "measurements.parquet"


def file_columns(joints: int) -> dict[str, Column]:
    """Every column that a file of measurements may have.

    Parameters
    ----------
    joints : int

    Returns
    -------
    dict of str to Column
    """
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


def read_measurements(folder: Path, joints: int, measured: str) -> MeasurementFile:
    """Open the measurements of a campaign.

    Parameters
    ----------
    folder : Path
        Holds either `CSV` or `PARQUET`.
    joints : int
    measured : {"position", "pose"}

    Returns
    -------
    MeasurementFile

    Raises
    ------
    InputError
        No file or two, a file that cannot be read, a column that is missing, unknown or there twice, a row of another length.
    """
    there = [path for path in (folder / CSV, folder / PARQUET) if path.is_file()]
    if len(there) != 1:
        found = "both" if there else "neither"
        raise InputError(folder.as_posix(), "", f"{found} {CSV} {'and' if there else 'nor'} {PARQUET}", "one of them")
    path = there[0].as_posix()
    columns, rows = (_read_csv if there[0].name == CSV else _read_parquet)(path)
    if len(rows) == 0:
        raise InputError(path, "", "no row of data", "one row for each measurement of one target")
    return MeasurementFile(path, columns, rows, joints, measured)


def check_column_names(names: Collection[str], joints: int, path: str) -> None:
    """Refuse a column that the format does not have.

    Parameters
    ----------
    names : iterable of str
    joints : int
    path : str
        Named in errors.

    Raises
    ------
    InputError
        The first such column.
    """
    known = file_columns(joints)
    for name in names:
        if name not in known:
            # That q7 is unknown helps little where it is not stated how many joints the robot has.
            of = f", for {joints} joints" if name.rstrip("0123456789") in ("q", "approach") else ""
            missing = [other for other in known if other not in names]
            raise InputError(path, "header", f"the unknown column {name!r}", closest_first(name, missing) + of)


def write_measurements(path: str, table: Mapping[str, Sequence[Any] | np.ndarray], joints: int) -> None:
    """Write the measurements of a campaign.

    Parameters
    ----------
    path : str
        Holds CSV where the name of the file that it stands for begins with that of `CSV`, else Parquet.
    table : dict of str to sequence
        Columns of one length, named as in `file_columns`.
    joints : int
    """
    columns = [column for name, column in file_columns(joints).items() if name in table]
    (_write_csv if Path(path).name.startswith(CSV) else _write_parquet)(path, columns, table)


def _read_csv(path: str) -> tuple[dict[str, tuple[str, ...]], np.ndarray]:
    try:
        # A byte order mark is what spreadsheets write.
        with open(path, encoding="utf-8-sig", newline="") as file:
            lines = list(csv.reader(file, skipinitialspace=True, strict=True))
    except UnicodeDecodeError as error:
        raise InputError(path, f"byte {error.start}", "text that is not UTF-8", "a UTF-8 file") from None
    except csv.Error as error:
        raise InputError(path, "", str(error), "comma-separated values") from None
    if not lines:
        raise InputError(path, "", "an empty file", "a header and one row for each measurement of one target")
    header = [cell.strip() for cell in lines[0]]
    if len(header) == 1 and any(separator in header[0] for separator in ";\t"):
        raise InputError(path, "header", repr(header[0][:40]), "columns separated by commas, decimals by a point")
    _check_header(path, header)
    kept = [(number, cells) for number, cells in enumerate(lines[1:], 1) if any(cell.strip() for cell in cells)]
    for number, cells in kept:
        if len(cells) != len(header):
            raise InputError(path, f"row {number}", f"{len(cells)} cells", f"{len(header)}, one for each column of the header")
    columns = dict(zip(header, zip(*(cells for _, cells in kept), strict=True), strict=True)) if kept else {}
    return columns, np.array([number for number, _ in kept], np.int32)


def _read_parquet(path: str) -> tuple[dict[str, Sequence[Any] | np.ndarray], np.ndarray]:
    try:
        # pyarrow's own complaint of a column that is there twice is a list of all columns.
        _check_header(path, pq.read_schema(path).names)
        table = pq.read_table(path)
        columns = [(name, _cells(column)) for name, column in zip(table.column_names, table.columns, strict=True)]
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise InputError(path, "", f"no readable Parquet file ({error})", "a Parquet file") from None
    return dict(columns), np.arange(1, table.num_rows + 1, dtype=np.int32)


def _cells(column: pa.ChunkedArray) -> Sequence[Any] | np.ndarray:
    """Cells of a column of Parquet: an array where all are numbers, which takes a fourth of the memory of a list."""
    numbers = pa.types.is_floating(column.type) or pa.types.is_integer(column.type)
    return column.to_numpy() if numbers and not column.null_count else column.to_pylist()


def _check_header(path: str, names: Sequence[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise InputError(path, "header", f"column {name!r} twice", "each column once")


class MeasurementFile:
    """A file of measurements, whose columns are checked as they are asked for.

    Attributes
    ----------
    path : str
    columns : dict of str to sequence
        Cells as they stand in the file.
    rows : ndarray of int32 (N,)
        Number in the file of each row that is not blank, 1 for the first of data.
    angles, wrench, approach, orientation : list of str
        Names of the columns that belong together; no orientation where positions are measured.
    """

    def __init__(
        self, path: str, columns: Mapping[str, Sequence[Any] | np.ndarray], rows: np.ndarray, joints: int, measured: str
    ) -> None:
        self.path, self.columns, self.rows = path, columns, rows
        known = file_columns(joints)
        self.angles = [f"q{j}" for j in range(1, joints + 1)]
        self.approach = [f"approach{j}" for j in range(1, joints + 1)]
        self.wrench = [name for name, _, _ in WRENCH]
        self.orientation = ["rx", "ry", "rz"] if measured == "pose" else []
        check_column_names(columns, joints, path)
        required = ["pose", "load", "repeat", "target", *self.angles, "x", "y", "z", *self.orientation]
        for group in (self.wrench, self.approach):
            required += group if any(name in columns for name in group) else []
        for name in required:
            if name not in columns:
                unit = f" in {known[name].unit}" if known[name].unit else ""
                raise self.fault("header", f"no column {name!r}", f"{name}: {known[name].meaning}{unit}")

    def fault(self, key: str, found: str, allowed: str) -> InputError:
        """InputError of this file."""
        return InputError(self.path, key, found, allowed)

    def cell_fault(self, index: int, name: str, found: str, allowed: str) -> InputError:
        """InputError of one cell; `index` counts the measurements."""
        return self.fault(f"row {self.rows[index]}, column {name}", found, allowed)

    def has(self, names: Iterable[str]) -> bool:
        """Whether all of some columns are there."""
        return all(name in self.columns for name in names)

    def numbers(self, names: Iterable[str]) -> np.ndarray:
        """ndarray (N, len(names)) of finite numbers."""
        return np.column_stack([self._column(name) for name in names])

    def integers(self, name: str) -> np.ndarray:
        """ndarray of int32 (N,)."""
        values = self._column(name)
        wrong = (values != np.round(values)) | (np.abs(values) >= 2**31)
        if wrong.any():
            index = int(np.argmax(wrong))
            raise self.cell_fault(index, name, shown(self.columns[name][index]), "an integer")
        return values.astype(np.int32)

    def texts(self, name: str) -> list[str]:
        """list of str (N,)."""
        return [str(cell).strip() for cell in self.columns[name]]

    def _column(self, name: str) -> np.ndarray:
        try:
            values = np.array(self.columns[name], float)
        except (ValueError, TypeError):
            index = next(i for i, cell in enumerate(self.columns[name]) if not _is_number(cell))
            raise self.cell_fault(index, name, shown(self.columns[name][index]), "a number with a decimal point") from None
        if not np.isfinite(values).all():
            index = int(np.argmin(np.isfinite(values)))
            raise self.cell_fault(index, name, shown(self.columns[name][index]), "a finite number")
        return values


def _is_number(cell: Any) -> bool:
    try:
        np.array([cell], float)
    except (ValueError, TypeError):
        return False
    return True


def shown(cell: Any) -> str:
    """A cell as an error shows it."""
    text = str(cell).strip() if cell is not None else ""
    return repr(text[:40]) if text else "nothing"


def _write_csv(path: str, columns: Iterable[Column], table: Mapping[str, Sequence[Any] | np.ndarray]) -> None:
    with open(path, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([column.name for column in columns])
        # repr of a float is the shortest text that reads back as the same number.
        writer.writerows(zip(*(np.asarray(table[column.name]).tolist() for column in columns), strict=True))


def _write_parquet(path: str, columns: Iterable[Column], table: Mapping[str, Sequence[Any] | np.ndarray]) -> None:
    fields = [pa.field(c.name, pa.type_for_alias(c.type), False, {"unit": c.unit, "meaning": c.meaning}) for c in columns]
    arrays = [pa.array(np.asarray(table[field.name]).tolist(), field.type) for field in fields]
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path, compression="zstd")


def closest_first(name: str, known: Collection[str]) -> str:
    """What is allowed instead of a name: the closest first."""
    lower = {other.lower(): other for other in known}
    close = difflib.get_close_matches(str(name).lower(), lower, n=1)
    return f"{lower[close[0]]!r}? ({', '.join(known)})" if close else ", ".join(known)
