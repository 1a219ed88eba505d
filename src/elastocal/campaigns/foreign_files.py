"""Tables that are no text: workbooks and MATLAB files are read as lines of text, and other
files of programs are named for what they are.

A pickle is never loaded, because loading one runs what it says.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from datetime import date, datetime, time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.errors import InputError, suggest_names

if TYPE_CHECKING:
    from openpyxl import Workbook

# Upper bounds on a file after it has been decompressed: text of a table of the largest
# size is no longer, and in memory a cell takes some hundred bytes.
_LARGEST_BYTES = 200_000_000
_MOST_CELLS = 5_000_000
_CELLS_SEPARATED_BY = "\t"
_SAVE_AS_TEXT = "CSV, with a line for each measurement"
# How files begin that programs write, and what they are.
_BEGINNINGS = {
    b"\xd0\xcf\x11\xe0": ("an old workbook (.xls)", "a workbook (.xlsx), or CSV"),
    b"\x89HDF\r\n": (
        "an HDF5 file, as MATLAB 7.3 writes",
        "a MATLAB file of version 7 (save -v7), or CSV",
    ),
    b"\x93NUMPY": ("an array of NumPy (.npy)", "CSV, by numpy.savetxt"),
    b"PAR1": ("a Parquet file", "CSV; a campaign itself may be measurements.parquet"),
    b"\x1f\x8b": ("a compressed file (gzip)", "the file inside of it"),
    b"SQLite format 3": ("a database of SQLite", _SAVE_AS_TEXT),
}
# Classes of MATLAB's matrices of numbers.
_NUMBERS = re.compile(r"double|single|u?int\d+")
_ZIP = b"PK\x03\x04"
_MATLAB = b"MATLAB 5.0 MAT-file"
# Protocols of pickles that begin with a mark, from 2 on; and the opcode at their end.
_PICKLE_PROTOCOLS = range(2, 6)
_PICKLE_END = b"."
_PICKLE_SUFFIXES = (".pkl", ".pickle", ".p")


def read_foreign_lines(
    content: bytes, path: str | Path, sheet: str | None, *, has_names: bool
) -> list[str] | None:
    """Read the lines of a workbook or a MATLAB file, cells separated by tabulators.

    Parameters
    ----------
    content : bytes of the file.
    path : for messages.
    sheet : name of the sheet, or of the variable; None if there is only one.
    has_names : whether the user states the names of the columns, so that the variables
        of a MATLAB file give none.

    Returns
    -------
    None if the file is text.

    Raises
    ------
    InputError
        If the file is of another kind, is too large or damaged, or has several sheets
        and none is stated.
    """
    if content.startswith(_ZIP):
        return _read_workbook(content, path, sheet)
    if content.startswith(_MATLAB):
        return _read_matlab(content, path, sheet, has_names=has_names)
    for beginning, (kind, allowed) in _BEGINNINGS.items():
        if content.startswith(beginning):
            raise InputError(path, "", kind, allowed)
    is_marked = (
        content[:1] == b"\x80" and content[1:2] and content[1] in _PICKLE_PROTOCOLS
    )
    is_named = Path(path).suffix.lower() in _PICKLE_SUFFIXES
    if (is_marked or is_named) and content.endswith(_PICKLE_END):
        raise InputError(
            path,
            "",
            "a pickle, which is never loaded",
            f"{_SAVE_AS_TEXT}, by its program",
        )
    if sheet is not None:
        raise InputError("--sheet", "", repr(sheet), "of a workbook or a MATLAB file")
    return None


def _read_workbook(content: bytes, path: str | Path, sheet: str | None) -> list[str]:
    """Read the lines of a sheet of a workbook; line and row have the same number."""
    _check_archive(content, path)
    try:
        from openpyxl import load_workbook
    except ImportError:
        allowed = f"{_SAVE_AS_TEXT}, or an environment with openpyxl"
        raise InputError(path, "", "a workbook", allowed) from None
    try:
        workbook = load_workbook(io.BytesIO(content), read_only=True, data_only=True)
        rows = _choose_sheet(workbook, path, sheet)
    except InputError:
        raise
    except Exception as error:
        # The library raises whatever its parts raise at a damaged file.
        finding = f"a damaged workbook ({error})"
        raise InputError(
            path, "", finding, "a workbook that a spreadsheet opens"
        ) from None
    return [_CELLS_SEPARATED_BY.join(map(_format_cell, row)) for row in rows]


def _check_archive(content: bytes, path: str | Path) -> None:
    """Refuse an archive that is no workbook, that grows without end when it is
    decompressed, or whose XML declares entities, which may do so too."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
            if "xl/workbook.xml" not in names:
                kind = "an archive (zip)"
                if "content.xml" in names:
                    kind = "a spreadsheet of OpenDocument (.ods)"
                elif any(name.endswith(".npy") for name in names):
                    kind = "arrays of NumPy (.npz)"
                raise InputError(path, "", kind, "a workbook (.xlsx), or CSV")
            size = sum(member.file_size for member in archive.infolist())
            if size > _LARGEST_BYTES:
                finding = f"a workbook of {size} bytes"
                raise InputError(path, "", finding, f"at most {_LARGEST_BYTES}")
            for member in archive.infolist():
                with archive.open(member) as file:
                    beginning = file.read(4096)
                if b"<!DOCTYPE" in beginning or b"<!ENTITY" in beginning:
                    finding = f"{member.filename} with a document type"
                    raise InputError(path, "", finding, "a workbook, which has none")
    except (zipfile.BadZipFile, OSError, NotImplementedError, RuntimeError) as error:
        finding = f"a damaged archive ({error})"
        raise InputError(
            path, "", finding, "a workbook that a spreadsheet opens"
        ) from None


def _choose_sheet(
    workbook: Workbook, path: str | Path, sheet: str | None
) -> list[tuple[Any, ...]]:
    """Return the rows of the stated sheet, or of the only one with cells."""
    names = workbook.sheetnames
    if sheet is not None and sheet not in names:
        raise InputError("--sheet", "", repr(sheet), suggest_names(sheet, names))
    chosen = {}
    for name in [sheet] if sheet is not None else names:
        rows = _read_sheet_rows(workbook[name].iter_rows(values_only=True), path)
        if rows:
            chosen[name] = rows
    if len(chosen) != 1:
        finding = f"sheets {', '.join(map(repr, chosen))}" if chosen else "no cell"
        raise InputError(path, "", finding, "--sheet NAME, one of them with cells")
    return next(iter(chosen.values()))


def _read_sheet_rows(
    sheet_rows: Iterable[tuple[Any, ...]], path: str | Path
) -> list[tuple[Any, ...]]:
    """Return the rows of a sheet up to the last one that has a cell."""
    rows: list[tuple[Any, ...]] = []
    used = 0
    count = 0
    for row in sheet_rows:
        count += len(row)
        if count > _MOST_CELLS:
            raise InputError(path, "", f"more than {_MOST_CELLS} cells", "fewer")
        rows.append(row)
        if any(cell is not None for cell in row):
            used = len(rows)
    return rows[:used]


def _format_cell(cell: Any) -> str:
    """Format a cell of a workbook; numbers with all their digits, dates as ISO 8601."""
    if cell is None:
        return ""
    if isinstance(cell, datetime):
        return cell.isoformat(" ")
    if isinstance(cell, date | time):
        return cell.isoformat()
    return " ".join(str(cell).split()).replace('"', "'")


def _read_matlab(
    content: bytes, path: str | Path, variable: str | None, *, has_names: bool
) -> list[str]:
    """Read the variables of a MATLAB file that have as many rows as the longest one.

    A variable of several columns has a number behind its name.
    """
    from scipy.io import loadmat, whosmat

    # The functions take files that are open, too, which their types do not say.
    stream: Any = io.BytesIO(content)
    try:
        shapes = {
            name: shape
            for name, shape, kind in whosmat(stream)
            if len(shape) == 2 and _NUMBERS.fullmatch(kind)
        }
        names = _choose_variables(shapes, path, variable)
        arrays = loadmat(stream, variable_names=names)
        columns = {name: np.asarray(arrays[name], float) for name in names}
    except InputError:
        raise
    except Exception as error:
        finding = f"a damaged MATLAB file ({error})"
        raise InputError(path, "", finding, "one that MATLAB opens") from None
    headers = []
    for name, array in columns.items():
        width = array.shape[1]
        headers += [name] if width == 1 else [f"{name}{n}" for n in range(1, width + 1)]
    lines = [] if has_names else [_CELLS_SEPARATED_BY.join(headers)]
    for row in np.hstack(list(columns.values())).tolist():
        lines.append(_CELLS_SEPARATED_BY.join(map(repr, row)))
    return lines


def _choose_variables(
    shapes: Mapping[str, Sequence[int]], path: str | Path, variable: str | None
) -> list[str]:
    """Choose the stated variable, or those with as many rows as the longest one."""
    if variable is not None:
        if variable not in shapes:
            allowed = suggest_names(variable, list(shapes))
            raise InputError("--sheet", "", repr(variable), allowed)
        shapes = {variable: shapes[variable]}
    if not shapes:
        allowed = "variables that are matrices, one row for each measurement"
        raise InputError(path, "", "no matrix of numbers", allowed)
    rows = max(shape[0] for shape in shapes.values())
    names = [name for name, shape in shapes.items() if shape[0] == rows]
    cells = sum(shapes[name][0] * shapes[name][1] for name in names)
    if cells > _MOST_CELLS:
        raise InputError(path, "", f"{cells} numbers", f"at most {_MOST_CELLS}")
    return names
