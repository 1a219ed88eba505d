"""Sources that are tables of text with a header: their columns by name, and the numbers in these."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from io import StringIO
from pathlib import Path

import numpy as np

from elastocal.campaigns.public_data import LARGEST_BYTES
from elastocal.counting import counted
from elastocal.errors import InputError
from elastocal.io.texts import read_text

_DECIMAL_WORDS = {",": "a number with a decimal comma, not infinite", ".": "a number, not infinite"}


def read_columns(path: str | Path, separator: str, needed: Iterable[str], kind: str) -> dict[str, tuple[str, ...]]:
    """Cells of a table, column by column; blank lines are left out.

    `separator`: between the cells of a line. `needed`: columns that must be there. `kind`: what the file should be, for the
    message where a column is missing. Returns by the names of the header. Raises `InputError`: no file, no row, rows of
    different lengths, a column that is missing.
    """
    file = StringIO(read_text(path, LARGEST_BYTES), newline="")
    try:
        lines = [line for line in csv.reader(file, delimiter=separator, strict=True) if line]
    except csv.Error as error:
        raise InputError(path, "", str(error), f"text with columns separated by {separator}") from None
    if len(lines) < 2:
        raise InputError(path, "", "no row of data", "a header and rows")
    header, rows = lines[0], lines[1:]
    for number, line in enumerate(rows, 1):
        if len(line) != len(header):
            raise InputError(
                path, f"row {number}", counted(len(line), "cell"), f"{len(header)}, one for each column of the header"
            )
    for name in needed:
        if name not in header:
            raise InputError(path, "header", f"no column {name!r}", kind)
    return dict(zip(header, zip(*rows, strict=True), strict=True))


def numbers(path: str | Path, name: str, cells: Sequence[str], decimal: str = ".") -> np.ndarray:
    """Numbers of one column.

    `name`: of the column. `decimal`: one of ".", ",". Returns (N,). Raises `InputError`: a cell that is no finite number.
    """
    values = np.full(len(cells), np.nan)
    for index, cell in enumerate(cells):
        with suppress(ValueError):
            values[index] = float(cell.replace(decimal, "."))
        if not np.isfinite(values[index]):
            raise InputError(path, f"row {index + 1}, column {name}", repr(cell), _DECIMAL_WORDS[decimal])
    return values


def table(path: str | Path, cells: Mapping[str, Sequence[str]], names: Iterable[str], decimal: str = ".") -> np.ndarray:
    """Numbers of some columns, ndarray (N, k).

    `cells`: from `read_columns`. `names`: of the columns. `decimal`: one of ".", ",". Raises `InputError`: as `numbers`.
    """
    return np.column_stack([numbers(path, name, cells[name], decimal) for name in names])
