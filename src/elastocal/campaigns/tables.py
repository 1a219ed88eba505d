"""Tables of numbers as text, in whatever dialect: encoding, separator, decimal mark,
lines before the header, comments.

Neither `csv.Sniffer`, which guesses, nor pandas, which knows no lines, can ask where a
table may be read in two ways.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from elastocal.counting import format_count
from elastocal.errors import InputError, find_control_character, suggest_names
from elastocal.io.texts import (
    LARGEST_NUMBER,
    NUMBER_ALLOWED,
    decode_text,
    parse_number,
    read_bytes,
)

# In this order: a header that holds a semicolon is not separated by its commas.
SEPARATORS = {"tab": "\t", "semicolon": ";", "bar": "|", "comma": ",", "space": " "}
DECIMALS = {"point": ".", "comma": ","}
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_COMMENTS = ("#", "%", "//")
_DECIMAL = {
    name: re.compile(rf"[+-]?\d*[{mark}]\d+([eE][+-]?\d+)?", re.ASCII)
    for name, mark in DECIMALS.items()
}
# Three digits behind a comma may stand between thousands; these do not.
_SURE = re.compile(
    rf"(?![+-]?[1-9]\d{{0,2}},\d{{3}}$){_DECIMAL['comma'].pattern}", re.ASCII
)
HEADER_WITHOUT_ROWS = "a header alone"
# The whole of it is in memory, as text and as cells: some 2 GB at most.
LARGEST_BYTES = 100_000_000
MOST_LINES = 500_000
# Lines of a file with their numbers, from 1.
_Lines = Sequence[tuple[int, str]]
# Least and largest value of a column, in its unit, and why. Generous: whatever lies
# beyond is in another unit, or no reading of an instrument beside a robot.
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
        "m, more than 0: a sixtieth of a laser's wavelength at least, at most what a robot is off by",
    ),
}


@dataclass(frozen=True)
class Dialect:
    """How a table is written; what is None is found out, or refused where it is
    ambiguous.

    `separator`, `decimal`: names in `SEPARATORS` and `DECIMALS`. `header`: line of the
    names of columns, from 1. `encoding`: as Python calls it.
    """

    separator: str | None = None
    decimal: str | None = None
    header: int | None = None
    encoding: str | None = None


_UNSTATED = Dialect()
_WANTED = (
    "columns x, y, z or such; --header LINE and --column x=NAME say which line and which columns they are, "
    "--columns q1,q2,… what the columns of a table without a header are"
)


@dataclass(frozen=True)
class Cells:
    """Columns of a table by name, as numbers in SI units or as texts; an `InputError`
    names the place of what is neither.

    `columns`: cells as they stand in the file. `rows` (N,): number of each row in the
    file, 1 for the first of data. `header_line`: line of the header, 0 where `rows` has
    lines, None where the file is no text. `headers`: what the file calls columns, if
    otherwise. `scales`: SI values of their units, if not 1.
    """

    path: str
    columns: Mapping[str, pa.ChunkedArray]
    rows: np.ndarray
    header_line: int | None = None
    headers: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)

    def fault(
        self, index: int, name: str, allowed: str, found: str | None = None
    ) -> InputError:
        """InputError of one cell, or without `name` of a row; `index` counts the
        rows."""
        place = self.place(index) + (
            f", column {self.headers.get(name, name)}" if name else ""
        )
        return InputError(
            self.path,
            place,
            _show(self.columns[name][index].as_py()) if found is None else found,
            allowed,
        )

    def refuse(
        self,
        wrong: np.ndarray,
        names: Sequence[str],
        allowed: str,
        found: str | None = None,
    ) -> None:
        """Refuse the first cell that is wrong, of bool (N, len(names)) or of one column
        (N,)."""
        if wrong.any():
            index, column = np.argwhere(wrong.reshape(len(wrong), -1))[0]
            raise self.fault(int(index), names[column], allowed, found)

    def place(self, index: int) -> str:
        """Where a row stands in the file."""
        row = int(self.rows[index])
        return (
            f"row {row}"
            if self.header_line is None
            else f"line {row + self.header_line}"
        )

    def numbers(self, name: str) -> np.ndarray:
        """ndarray (N,) of finite numbers."""
        try:
            values = self.columns[name].cast(pa.float64()).to_numpy()
        except pa.ArrowInvalid:
            # A cell is none, or written as a spreadsheet does.
            found = [parse_number(str(cell)) for cell in self.columns[name].to_pylist()]
            values = np.array(
                [np.nan if number is None else number for number in found]
            )
        # Not a number is no more than anything either.
        self.refuse(~(np.abs(values) <= LARGEST_NUMBER), [name], NUMBER_ALLOWED)
        return self.bounded(name, values * self.scales.get(name, 1.0))

    def bounded(self, name: str, values: np.ndarray) -> np.ndarray:
        """The same values (N,) of a column, all of which physics allows."""
        least, largest, why = BOUNDS.get(name, (-np.inf, np.inf, ""))
        self.refuse(
            ~((values >= least) & (values <= largest)),
            [name],
            f"{least:g} to {largest:g} {why}",
        )
        return values

    def matrix(self, names: Iterable[str]) -> np.ndarray:
        """ndarray (N, len(names)) of finite numbers."""
        return np.column_stack([self.numbers(name) for name in names])

    def integers(self, name: str) -> np.ndarray:
        """ndarray of int32 (N,)."""
        values = self.numbers(name)
        self.refuse(
            (values != np.round(values)) | (np.abs(values) >= 2**31),
            [name],
            f"an integer, up to {2**31 - 1}",
        )
        return values.astype(np.int32)

    def texts(self, name: str) -> list[str]:
        """list of str (N,)."""
        column = self.columns[name]
        encoded = (
            column
            if pa.types.is_dictionary(column.type)
            else column.cast(pa.string()).dictionary_encode()
        )
        whole = encoded.unify_dictionaries().combine_chunks()
        words = [str(word).strip() for word in whole.dictionary.to_pylist()]
        return [
            "" if code is None else words[code] for code in whole.indices.to_pylist()
        ]


def _show(cell: Any) -> str:
    text = "" if cell is None else str(cell).strip().removesuffix(".0")
    return repr(text[:40]) if text else "nothing"


@dataclass(frozen=True)
class TextTable:
    """Cells of a table: decimal points throughout; `lines` has the line of the file of
    each row.

    `units`: of the columns that have one in a row of units under the header.
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
        """Columns by other names, their headers by these; SI values of their units; of
        the rows kept, if not all."""
        rows = np.arange(len(self.lines)) if kept is None else kept
        chosen = {
            name: pa.chunked_array([[self.columns[header][row] for row in rows]])
            for name, header in columns.items()
        }
        return Cells(self.path, chosen, np.array(self.lines)[rows], 0, columns, scales)


def read_text_table(
    path: str | Path,
    is_header: Callable[[Sequence[str]], bool],
    stated: Dialect = _UNSTATED,
    ignored: Collection[str] = (),
    wanted: str = _WANTED,
    units_in: Callable[[Sequence[str]], Sequence[str] | None] = lambda cells: None,
    names: Sequence[str] = (),
) -> TextTable:
    """Read a table, finding out what is not stated of its dialect.

    Columns without a name are called ``column 3`` by their place; those of empty cells
    are left out, and so are such rows.

    `is_header`: of the cells of a line, whether they name the columns; the first such
    line does where no line is stated, else one behind a comment mark. `wanted`: what a
    header has, for messages. `ignored`: names of columns that are left out whatever
    they hold. `units_in`: the units of a row of cells that is nothing but units, such
    as one under the header. `names`: of all columns of a table without a header. Raises
    `InputError`: a file that cannot be read or has no header, a row of another length,
    or numbers that may be read in two ways.
    """
    source = Path(path).as_posix()
    lines, encoding = _read_lines(path, stated.encoding)
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    kept = [
        (number, line)
        for number, line in filled
        if not line.lstrip().startswith(_COMMENTS)
    ]
    comments = [
        (number, line.lstrip().lstrip("#%/").strip())
        for number, line in filled
        if line.lstrip().startswith(_COMMENTS)
    ]
    if not kept:
        raise InputError(
            source,
            "",
            "nothing but comments and blank lines",
            "a header and one row for each measurement",
        )
    if names:
        separator = _marks_in(kept[0][1], stated, "comma")[0]
        header = 0
    else:
        separator, header, line = _find_header(
            kept, comments, is_header, stated, wanted, source
        )
        names = _split_cells(line, separator, source, header)
    names = [name or f"column {place}" for place, name in enumerate(names, 1)]
    where = f"line {header}" if header else "--columns"
    split = (
        (number, _split_cells(line, separator, source, number))
        for number, line in kept
        if number > header
    )
    rows = [(number, cells) for number, cells in split if any(cells)]
    for number, cells in rows:
        # Separators at the end of the rows and not of the header are common.
        while len(cells) > len(names) and not cells[-1]:
            cells.pop()
        if len(cells) != len(names):
            allowed = f"{len(names)}, one for each column of {where}"
            raise InputError(
                source, f"line {number}", format_count(len(cells), "cell"), allowed
            )
    units = dict(zip(names, (rows and units_in(rows[0][1])) or (), strict=False))
    rows = rows[1:] if units else rows
    if not rows:
        raise InputError(
            source, "", HEADER_WITHOUT_ROWS, "one row for each measurement"
        )
    if unknown := next((name for name in ignored if name not in names), None):
        raise InputError(
            source,
            where,
            f"no column {unknown!r} to ignore",
            suggest_names(unknown, list(dict.fromkeys(names))),
        )
    numbers = [number for number, _ in rows]
    cells_of = zip(*(cells for _, cells in rows), strict=True)
    there = [
        (name, cells)
        for place, (name, cells) in enumerate(zip(names, cells_of, strict=True), 1)
        if name not in ignored and (any(cells) or name != f"column {place}")
    ]
    columns = dict(there)
    if len(columns) < len(there):
        twice = Counter(name for name, _ in there).most_common(1)[0][0]
        allowed = f"each column once (import csv --ignore {twice!r} leaves out those that nobody needs)"
        raise InputError(source, where, f"column {twice!r} twice", allowed)
    decimal = stated.decimal or _find_decimal(columns, numbers, separator, source)
    comma = _DECIMAL["comma"]
    if decimal == "comma":
        columns = {
            name: tuple(
                cell.replace(",", ".") if comma.fullmatch(cell) else cell
                for cell in cells
            )
            for name, cells in columns.items()
        }
    below = {name: unit for name, unit in units.items() if unit and name in columns}
    return TextTable(
        source,
        Dialect(separator, decimal, header or None, encoding),
        columns,
        tuple(numbers),
        below,
    )


def _read_lines(path: str | Path, encoding: str | None) -> tuple[list[str], str]:
    """Lines as editors count them, and the encoding: the stated one, that of a byte
    order mark, or UTF-8.

    Refused are control characters and marks that turn the order of letters.
    """
    content = read_bytes(
        path, LARGEST_BYTES, "a table with a line for each measurement"
    )
    found = encoding or next(
        (name for mark, name in _MARKS if content.startswith(mark)), "utf-8"
    )
    try:
        text = decode_text(content, path, found).removeprefix("\ufeff")
    except InputError as error:
        allowed = "UTF-8 (iconv -f cp1252 -t utf-8), or in import csv --encoding cp1252, shift_jis, gb18030 or such"
        raise InputError(
            path, error.key, error.found, allowed if found == "utf-8" else error.allowed
        ) from None
    except (LookupError, ValueError) as error:
        known = "an encoding as Python calls it, such as utf-8, cp1252, cp437, mac-roman, shift_jis, gb18030 or utf-16-le"
        raise InputError("--encoding", "", f"{encoding!r}: {error}", known) from None
    count = (
        text.count("\n")
        + text.count("\r")
        - text.count("\r\n")
        + (text[-1:] not in ("\n", "\r"))
    )
    if count > MOST_LINES:
        allowed = f"at most {MOST_LINES} (the mean of a tracker's stream at each pose is one measurement)"
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
    return lines, found


def _marks_in(line: str, stated: Dialect, *otherwise: str) -> list[str]:
    """Separators that a line may have: the stated one, else those that stand in it."""
    return (
        [stated.separator]
        if stated.separator
        else [*(n for n, mark in SEPARATORS.items() if mark in line), *otherwise]
    )


def _find_header(
    kept: _Lines,
    comments: _Lines,
    is_header: Callable[[Sequence[str]], bool],
    stated: Dialect,
    wanted: str,
    source: str,
) -> tuple[str, int, str]:
    """Separator, and number and text of the line that names the columns."""
    if stated.header is not None:
        if line := dict((*kept, *comments)).get(stated.header):
            return _marks_in(line, stated, "comma")[0], stated.header, line
        raise InputError(
            source,
            f"line {stated.header}",
            "no header",
            "the line that names the columns",
        )
    for number, line in (*kept, *comments):
        if name := next(
            (
                name
                for name in _marks_in(line, stated)
                if is_header(_split_cells(line, name))
            ),
            None,
        ):
            return name, number, line
    raise InputError(source, f"line {kept[0][0]}", repr(kept[0][1][:60]), wanted)


def _split_cells(
    line: str, separator: str, source: str = "", number: int = 0
) -> list[str]:
    """Cells of one line; quotes that are not in pairs and a cell of more than 100,000
    characters are refused.

    Without its number a line is a comment or a title, in which quotes need not be in
    pairs: it has no cells.
    """
    mark = SEPARATORS[separator]
    if mark == " ":
        return line.split()
    try:
        row = next(
            csv.reader([line], delimiter=mark, skipinitialspace=True, strict=True)
        )
    except csv.Error as error:
        if not number:
            return []
        raise InputError(
            source,
            f"line {number}",
            str(error),
            "cells separated by one mark, quotes in pairs",
        ) from None
    return [cell.strip() for cell in row]


def _find_decimal(
    columns: dict[str, tuple[str, ...]],
    lines: Sequence[int],
    separator: str,
    source: str,
) -> str:
    """The decimal mark that all numbers have; refused are numbers that may be read in
    two ways."""

    def first(pattern: re.Pattern[str], mark: str) -> tuple[int, str] | None:
        rows = zip(lines, zip(*columns.values(), strict=True), strict=True)
        return next(
            (
                (number, cell)
                for number, row in rows
                for cell in row
                if mark in cell and pattern.fullmatch(cell)
            ),
            None,
        )

    point, comma = (first(_DECIMAL[name], mark) for name, mark in DECIMALS.items())
    if point and comma:
        allowed = "one decimal mark, and none between thousands; --decimal point or comma says which"
        raise InputError(
            source,
            "",
            f"{point[1]!r} in line {point[0]} and {comma[1]!r} in line {comma[0]}",
            allowed,
        )
    if comma and (separator == "comma" or not first(_SURE, ",")):
        allowed = "--decimal comma where the comma is the decimal mark, or numbers without marks between thousands"
        raise InputError(source, f"line {comma[0]}", repr(comma[1]), allowed)
    return "comma" if comma else "point"
