"""Read tables of numbers from text files of any dialect: encoding, separator, decimal
mark, lines before the header and comments are found out.

`csv.Sniffer` guesses, and pandas does not report line numbers. This module refuses a
table that can be read in two ways, and names the line.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from elastocal.campaigns.foreign_files import read_foreign_lines
from elastocal.counting import format_count
from elastocal.errors import InputError, find_control_character, suggest_names
from elastocal.io.texts import (
    LARGEST_NUMBER,
    NUMBER_ALLOWED,
    decode_text,
    parse_number,
    read_bytes,
)

# Tried in this order: commas do not separate a header that has a semicolon.
SEPARATORS = {"tab": "\t", "semicolon": ";", "bar": "|", "comma": ",", "space": " "}
DECIMALS = {"point": ".", "comma": ","}
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_COMMENT_MARKS = ("#", "%", "//")
_DECIMAL_NUMBER = {
    name: re.compile(rf"[+-]?\d*[{mark}]\d+([eE][+-]?\d+)?", re.ASCII)
    for name, mark in DECIMALS.items()
}
# In 1,234 the comma may stand between thousands. This pattern matches the numbers in
# which it must be the decimal mark.
_CERTAIN_DECIMAL_COMMA = re.compile(
    rf"(?![+-]?[1-9]\d{{0,2}},\d{{3}}$){_DECIMAL_NUMBER['comma'].pattern}", re.ASCII
)
# A number with spaces between thousands, as ISO 80000-1 writes it. A tabulator or a
# line break is none of these spaces.
_SPACED_NUMBER = re.compile(
    r"[+-]?\d{1,3}(?:[ \u00a0\u2009\u202f]\d{3})+(?:[.,]\d+)?", re.ASCII
)
HEADER_WITHOUT_ROWS = "a header alone"
# Upper bounds on the size of a text table. The whole table is in memory, as text and
# as cells, which takes up to some 2 GB at these bounds.
LARGEST_BYTES = 100_000_000
MOST_LINES = 500_000
# Smallest and largest value of a column, in its unit, with the reason. The bounds are
# generous: a value beyond them is in another unit, or no instrument on a robot gives it.
BOUNDS: Mapping[str, tuple[float, float, str]] = {
    **dict.fromkeys(
        ("fx", "fy", "fz"), (-1e6, 1e6, "N, the weight of a hundred tonnes")
    ),
    **dict.fromkeys(
        ("mx", "my", "mz"),
        (-1e7, 1e7, "N m, a hundred tonnes on a lever of ten metres"),
    ),
    **dict.fromkeys("xyz", (-2e7, 2e7, "m, half the circumference of the Earth")),
    "time_s": (
        -1e11,
        1e11,
        "s, three thousand years either way: not milliseconds of a calendar",
    ),
    "temperature_c": (-200.0, 200.0, "°C, in which arms work, not kelvin"),
    "u95_m": (
        1e-8,
        0.1,
        (
            "m, more than 0: at least a sixtieth of a laser's wavelength, "
            "at most the error of a robot"
        ),
    ),
}
# Lines of a file with their numbers, from 1.
_NumberedLines = Sequence[tuple[int, str]]
# Rows of a table: number of the line and cells.
_Rows = list[tuple[int, list[str]]]


@dataclass(frozen=True)
class Dialect:
    """How a table is written. A field that is None is found out; an ambiguous table is
    refused.

    Attributes
    ----------
    separator, decimal : names in `SEPARATORS` and `DECIMALS`.
    header : line with the names of the columns, from 1.
    encoding : as Python names it.
    sheet : sheet of a workbook, or variable of a MATLAB file; None for the only one.
    """

    separator: str | None = None
    decimal: str | None = None
    header: int | None = None
    encoding: str | None = None
    sheet: str | None = None


_UNSTATED = Dialect()
_HEADER_ALLOWED = (
    "columns such as x, y, z; --header LINE states the line of their names, --column "
    "x=NAME another name, and --columns q1,q2,… the columns of a table without a header"
)


@dataclass(frozen=True)
class Cells:
    """Columns of a table as numbers in SI units or as texts.

    An `InputError` names the row and column of a cell that is neither.

    Attributes
    ----------
    path : file of the table, for messages.
    columns : cells as they are in the file, by name.
    rows : (N,) int array, number of each row in the file, from 1 for the first row of
        data; numbers of lines if `header_line` is 0.
    header_line : line of the header; None if the file is not text.
    headers : names of columns in the file, where they differ from those in `columns`.
    scales : SI value of the unit of a column, where it is not 1.
    """

    path: str
    columns: Mapping[str, pa.ChunkedArray]
    rows: np.ndarray
    header_line: int | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)

    def select(self, chosen: np.ndarray) -> "Cells":
        """Select rows, given as an index array."""
        columns = {name: column.take(chosen) for name, column in self.columns.items()}
        return replace(self, columns=columns, rows=self.rows[chosen])

    def fault(
        self, index: int, name: str, allowed: str, finding: str | None = None
    ) -> InputError:
        """Return the InputError of one cell.

        Parameters
        ----------
        index : row, from 0.
        name : column; empty if the whole row is at fault.
        allowed : what the cell may hold.
        finding : what is at fault, if not the contents of the cell.
        """
        key = self.locate(index)
        if name:
            key += f", column {self.headers.get(name, name)}"
        if finding is None:
            finding = _quote_cell(self.columns[name][index].as_py())
        return InputError(self.path, key, finding, allowed)

    def refuse(
        self,
        wrong: np.ndarray,
        names: Sequence[str],
        allowed: str,
        finding: str | None = None,
    ) -> None:
        """Raise the InputError of the first wrong cell, if any.

        Parameters
        ----------
        wrong : (N, len(names)) bool array, or (N,) of one column.
        names : columns.
        allowed, finding : as in `fault`.
        """
        if wrong.any():
            index, column = np.argwhere(wrong.reshape(len(wrong), -1))[0]
            raise self.fault(int(index), names[column], allowed, finding)

    def locate(self, index: int) -> str:
        """Return where a row, counted from 0, is in the file."""
        row = int(self.rows[index])
        if self.header_line is None:
            return f"row {row}"
        return f"line {row + self.header_line}"

    def numbers(self, name: str) -> np.ndarray:
        """Return a column as an (N,) array of finite numbers within its bounds."""
        try:
            values = self.columns[name].cast(pa.float64()).to_numpy()
        except pa.ArrowInvalid:
            # A cell is not a number, or is written as a spreadsheet writes it.
            parsed = [
                parse_number(str(cell)) for cell in self.columns[name].to_pylist()
            ]
            values = np.array(
                [np.nan if number is None else number for number in parsed]
            )
        # The comparison is false for NaN, which is therefore refused too.
        self.refuse(~(np.abs(values) <= LARGEST_NUMBER), [name], NUMBER_ALLOWED)
        return self.bounded(name, values * self.scales.get(name, 1.0))

    def bounded(self, name: str, values: np.ndarray) -> np.ndarray:
        """Return the values (N,) of a column; refuse one beyond its `BOUNDS`."""
        lowest, largest, reason = BOUNDS.get(name, (-np.inf, np.inf, ""))
        outside = ~((values >= lowest) & (values <= largest))
        self.refuse(outside, [name], f"{lowest:g} to {largest:g} {reason}")
        return values

    def matrix(self, names: Iterable[str]) -> np.ndarray:
        """Return columns as an (N, len(names)) array of finite numbers."""
        return np.column_stack([self.numbers(name) for name in names])

    def integers(self, name: str) -> np.ndarray:
        """Return a column as an (N,) array of int32."""
        values = self.numbers(name)
        self.refuse(
            (values != np.round(values)) | (np.abs(values) >= 2**31),
            [name],
            f"an integer, up to {2**31 - 1}",
        )
        return values.astype(np.int32)

    def texts(self, name: str) -> list[str]:
        """Return the texts of a column without the blanks around them."""
        column = self.columns[name]
        if not pa.types.is_dictionary(column.type):
            column = column.cast(pa.string()).dictionary_encode()
        encoded = column.unify_dictionaries().combine_chunks()
        texts = [str(text).strip() for text in encoded.dictionary.to_pylist()]
        return [
            "" if code is None else texts[code] for code in encoded.indices.to_pylist()
        ]


def _quote_cell(cell: Any) -> str:
    """Return the contents of a cell for a message."""
    text = "" if cell is None else str(cell).strip().removesuffix(".0")
    return repr(text[:40]) if text else "nothing"


@dataclass(frozen=True)
class TextTable:
    """Cells of a text table, all with decimal points.

    Attributes
    ----------
    path : file of the table.
    dialect : how the file is written.
    columns : cells by the names of the columns.
    lines : line of each row in the file.
    units : units of the columns that have one in a row of units under the header.
    """

    path: str
    dialect: Dialect
    columns: dict[str, tuple[str, ...]]
    lines: tuple[int, ...]
    units: dict[str, str] = field(default_factory=dict)

    def cells(
        self,
        columns: Mapping[str, str],
        scales: Mapping[str, float],
        kept: np.ndarray | None = None,
    ) -> Cells:
        """Return columns under other names.

        Parameters
        ----------
        columns : names in the file by the new names.
        scales : SI values of the units, by the new names.
        kept : rows to take; all if None.
        """
        rows = np.arange(len(self.lines)) if kept is None else kept
        chosen = {
            name: _take(self.columns[header], rows) for name, header in columns.items()
        }
        return Cells(self.path, chosen, np.array(self.lines)[rows], 0, columns, scales)


def _take(cells: Sequence[str], rows: np.ndarray) -> pa.ChunkedArray:
    return pa.chunked_array([[cells[row] for row in rows]])


@dataclass(frozen=True)
class _Header:
    """Names of the columns, and how they and all other rows are separated.

    `line` is 0 if the file has no header and the user stated the names.
    """

    separator: str
    line: int
    names: list[str]

    @property
    def origin(self) -> str:
        """Where the names of the columns come from, for messages."""
        return f"line {self.line}" if self.line else "--columns"


def read_text_table(  # noqa: PLR0913 - independent options
    path: str | Path,
    is_header: Callable[[Sequence[str]], bool],
    stated: Dialect = _UNSTATED,
    ignored: Collection[str] = (),
    wanted: str = _HEADER_ALLOWED,
    units_in: Callable[[Sequence[str]], Sequence[str] | None] = lambda cells: None,
    names: Sequence[str] = (),
) -> TextTable:
    """Read a table and find out everything about its dialect that is not stated.

    A column without a name gets one from its place, such as ``column 3``. Empty columns
    without a name and empty rows are left out.

    Parameters
    ----------
    path : file of the table.
    is_header : whether the cells of a line name the columns. If no line is stated, the
        first such line is the header, or else the first such comment.
    stated : what the user says of the dialect.
    ignored : columns to leave out whatever they hold.
    wanted : what a header looks like, for messages.
    units_in : units of a row that consists of units alone, such as one under the
        header; None for any other row.
    names : names of all columns of a table without a header.

    Raises
    ------
    InputError
        If the file cannot be read, has no header or a row of another length, or if its
        numbers can be read in two ways.
    """
    source = Path(path).as_posix()
    lines, encoding = _read_lines(path, stated, has_names=bool(names))
    data_lines, comments = _separate_comments(lines)
    if not data_lines:
        raise InputError(
            source,
            "",
            "nothing but comments and blank lines",
            "a header and one row for each measurement",
        )
    if names:
        separator = _possible_separators(data_lines[0][1], stated, "comma")[0]
        header = _Header(separator, 0, list(names))
    else:
        header = _find_header(data_lines, comments, is_header, stated, wanted, source)
    header = _name_unnamed_columns(header)
    rows = _read_rows(data_lines, header, source)
    units: dict[str, str] = {}
    if rows and (row_of_units := units_in(rows[0][1])):
        units = dict(zip(header.names, row_of_units, strict=False))
        rows = rows[1:]
    if not rows:
        allowed = "one row for each measurement"
        raise InputError(source, "", HEADER_WITHOUT_ROWS, allowed)
    columns = _collect_columns(rows, header, ignored, source)
    columns = _join_thousands(columns)
    line_numbers = [number for number, _ in rows]
    decimal = stated.decimal or _find_decimal(
        columns, line_numbers, header.separator, source
    )
    if decimal == "comma":
        columns = _with_decimal_points(columns)
    return TextTable(
        source,
        Dialect(header.separator, decimal, header.line or None, encoding, stated.sheet),
        columns,
        tuple(line_numbers),
        {name: unit for name, unit in units.items() if unit and name in columns},
    )


def _read_lines(
    path: str | Path, stated: Dialect, *, has_names: bool
) -> tuple[list[str], str]:
    """Return the lines as editors count them, or the rows of a workbook, and the
    encoding.

    The encoding is the stated one, that of a byte order mark, or UTF-8. Control
    characters and marks that change the direction of writing are refused.
    """
    content = read_bytes(
        path, LARGEST_BYTES, "the path of a table, one line for each pose"
    )
    foreign_lines = read_foreign_lines(content, path, stated.sheet, has_names=has_names)
    encoding = "utf-8"
    if foreign_lines is None:
        text, encoding = _decode_table(content, path, stated.encoding)
    else:
        text = "\n".join(foreign_lines)
    count = text.count("\n") + text.count("\r") - text.count("\r\n")
    if text[-1:] not in ("\n", "\r"):
        count += 1
    if count > MOST_LINES:
        allowed = (
            f"at most {MOST_LINES} (average the tracker's stream at each pose "
            "to one measurement)"
        )
        raise InputError(path, "", format_count(count, "line"), allowed)
    lines = re.split(r"\r\n|\n|\r", text)
    for number, line in enumerate(lines, 1):
        if character := find_control_character(line.replace("\t", " ")):
            allowed = (
                "printable characters, in UTF-8, or in UTF-16 with a byte order mark"
            )
            raise InputError(
                path, f"line {number}", f"the character {character!a}", allowed
            )
    return lines, encoding


def _decode_table(
    content: bytes, path: str | Path, stated: str | None
) -> tuple[str, str]:
    """Return the text of a file, without its byte order mark, and its encoding."""
    encoding = stated or next(
        (name for mark, name in _BYTE_ORDER_MARKS if content.startswith(mark)), "utf-8"
    )
    try:
        text = decode_text(content, path, encoding)
    except InputError as error:
        allowed = error.allowed
        if encoding == "utf-8":
            allowed = (
                "UTF-8 (iconv -f cp1252 -t utf-8), or in import csv --encoding cp1252, "
                "shift_jis, gb18030 or such"
            )
        raise InputError(path, error.key, error.found, allowed) from None
    except (LookupError, ValueError) as error:
        allowed = (
            "an encoding as Python calls it, such as utf-8, cp1252, cp437, mac-roman, "
            "shift_jis, gb18030 or utf-16-le"
        )
        raise InputError("--encoding", "", f"{stated!r}: {error}", allowed) from None
    return text.removeprefix("\ufeff"), encoding


def _separate_comments(
    lines: Iterable[str],
) -> tuple[_NumberedLines, _NumberedLines]:
    """Return the lines with data or a header, and the comments without their marks;
    blank lines are in neither."""
    data_lines = []
    comments = []
    for number, line in enumerate(lines, 1):
        text = line.lstrip()
        if text.startswith(_COMMENT_MARKS):
            comments.append((number, text.lstrip("#%/").strip()))
        elif text:
            data_lines.append((number, line))
    return data_lines, comments


def _possible_separators(line: str, stated: Dialect, *default: str) -> list[str]:
    """Return the separators that a line may have: the stated one, or those that occur
    in it, and then the default."""
    if stated.separator:
        return [stated.separator]
    return [*(name for name, mark in SEPARATORS.items() if mark in line), *default]


def _find_header(
    data_lines: _NumberedLines,
    comments: _NumberedLines,
    is_header: Callable[[Sequence[str]], bool],
    stated: Dialect,
    wanted: str,
    source: str,
) -> _Header:
    """Find the line that names the columns."""
    candidates = (*data_lines, *comments)
    if stated.header is not None:
        line = dict(candidates).get(stated.header)
        if not line:
            allowed = "the line that names the columns"
            raise InputError(source, f"line {stated.header}", "no header", allowed)
        separator = _possible_separators(line, stated, "comma")[0]
        cells = _split_cells(line, separator, source, stated.header)
        return _Header(separator, stated.header, cells)
    for number, line in candidates:
        for separator in _possible_separators(line, stated):
            if is_header(_split_title(line, separator)):
                cells = _split_cells(line, separator, source, number)
                return _Header(separator, number, cells)
    number, line = data_lines[0]
    raise InputError(source, f"line {number}", repr(line[:60]), wanted)


def _name_unnamed_columns(header: _Header) -> _Header:
    names = [
        name or _default_name(number) for number, name in enumerate(header.names, 1)
    ]
    return _Header(header.separator, header.line, names)


def _default_name(number: int) -> str:
    return f"column {number}"


def _split_cells(line: str, separator: str, source: str, number: int) -> list[str]:
    """Return the cells of a line; unpaired quotes and a cell of more than 100,000
    characters are refused."""
    mark = SEPARATORS[separator]
    if mark == " ":
        return line.split()
    try:
        reader = csv.reader([line], delimiter=mark, skipinitialspace=True, strict=True)
        return [cell.strip() for cell in next(reader)]
    except csv.Error as error:
        allowed = "cells separated by one mark, quotes in pairs"
        raise InputError(source, f"line {number}", str(error), allowed) from None


def _split_title(line: str, separator: str) -> list[str]:
    """Return the cells of a line that may be a comment or a title. Its quotes need not
    be in pairs; it has no cells then."""
    try:
        return _split_cells(line, separator, "", 0)
    except InputError:
        return []


def _read_rows(data_lines: _NumberedLines, header: _Header, source: str) -> _Rows:
    """Return the rows below the header that are not empty, all of the header's
    length."""
    length = len(header.names)
    rows = []
    for number, line in data_lines:
        if number <= header.line:
            continue
        cells = _split_cells(line, header.separator, source, number)
        if not any(cells):
            continue
        # Rows often end with separators that the header does not have.
        while len(cells) > length and not cells[-1]:
            cells.pop()
        if len(cells) != length:
            finding = format_count(len(cells), "cell")
            allowed = f"{length}, one for each column of {header.origin}"
            raise InputError(source, f"line {number}", finding, allowed)
        rows.append((number, cells))
    return rows


def _collect_columns(
    rows: _Rows, header: _Header, ignored: Collection[str], source: str
) -> dict[str, tuple[str, ...]]:
    """Return the cells of each column by its name, without ignored columns and empty
    ones that have no name."""
    names = header.names
    unknown = next((name for name in ignored if name not in names), None)
    if unknown is not None:
        raise InputError(
            source,
            header.origin,
            f"no column {unknown!r} to ignore",
            suggest_names(unknown, list(dict.fromkeys(names))),
        )
    cells_by_column = zip(*(cells for _, cells in rows), strict=True)
    columns: dict[str, tuple[str, ...]] = {}
    counts = Counter[str]()
    for number, cells in enumerate(cells_by_column, 1):
        name = names[number - 1]
        is_empty = name == _default_name(number) and not any(cells)
        if name not in ignored and not is_empty:
            counts[name] += 1
            columns[name] = cells
    name, count = counts.most_common(1)[0] if counts else ("", 0)
    if count > 1:
        allowed = (
            f"each column once (import csv --ignore {name!r} leaves out those that "
            "nobody needs)"
        )
        raise InputError(source, header.origin, f"column {name!r} twice", allowed)
    return columns


def _find_decimal(
    columns: Mapping[str, tuple[str, ...]],
    line_numbers: Sequence[int],
    separator: str,
    source: str,
) -> str:
    """Return the decimal mark of all numbers, as in `DECIMALS`; refuse numbers that can
    be read in two ways."""

    def find_first(pattern: re.Pattern[str], mark: str) -> tuple[int, str] | None:
        """Return the line and text of the first cell that matches."""
        rows = zip(line_numbers, zip(*columns.values(), strict=True), strict=True)
        return next(
            (
                (number, cell)
                for number, row in rows
                for cell in row
                if mark in cell and pattern.fullmatch(cell)
            ),
            None,
        )

    point = find_first(_DECIMAL_NUMBER["point"], ".")
    comma = find_first(_DECIMAL_NUMBER["comma"], ",")
    if comma is None:
        return "point"
    if point is not None:
        finding = f"{point[1]!r} in line {point[0]} and {comma[1]!r} in line {comma[0]}"
        allowed = (
            "one decimal mark, and none between thousands; --decimal point or comma "
            "says which"
        )
        raise InputError(source, "", finding, allowed)
    if separator == "comma" or not find_first(_CERTAIN_DECIMAL_COMMA, ","):
        allowed = (
            "--decimal comma where the comma is the decimal mark, or numbers without "
            "marks between thousands"
        )
        raise InputError(source, f"line {comma[0]}", repr(comma[1]), allowed)
    return "comma"


def _join_thousands(
    columns: Mapping[str, tuple[str, ...]],
) -> dict[str, tuple[str, ...]]:
    """Return the same cells without the spaces in numbers such as 1 203,114."""

    def convert(cell: str) -> str:
        return "".join(cell.split()) if _SPACED_NUMBER.fullmatch(cell) else cell

    return {name: tuple(map(convert, cells)) for name, cells in columns.items()}


def _with_decimal_points(
    columns: Mapping[str, tuple[str, ...]],
) -> dict[str, tuple[str, ...]]:
    """Return the same cells with a point for the comma of each number."""
    number = _DECIMAL_NUMBER["comma"]

    def convert(cell: str) -> str:
        return cell.replace(",", ".") if number.fullmatch(cell) else cell

    return {name: tuple(map(convert, cells)) for name, cells in columns.items()}
