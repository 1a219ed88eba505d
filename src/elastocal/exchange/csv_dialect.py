"""Tables of numbers as text, in whatever dialect: separator, decimal mark, byte order, lines before the header, comments."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from elastocal.errors import InputError, steering
from elastocal.io.texts import decoded, read_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

# In this order: a header that holds a semicolon is not separated by its commas.
SEPARATORS = {"tab": "\t", "semicolon": ";", "bar": "|", "comma": ",", "space": " "}
DECIMALS = {"point": ".", "comma": ","}
_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_COMMENTS = ("#", "%", "//")
_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
_ENDS = re.compile(r"\r\n|\n|\r")
# The whole of it is in memory, as text and as cells: some 2 GB at most.
LARGEST_BYTES, MOST_LINES = 100_000_000, 500_000


@dataclass(frozen=True)
class Dialect:
    """How a table is written.

    Attributes
    ----------
    separator, decimal : str
        Names in `SEPARATORS` and `DECIMALS`.
    header : int
        Line of the names of columns, from 1.
    """

    separator: str
    decimal: str
    header: int


@dataclass(frozen=True)
class TextTable:
    """Cells of a table.

    Attributes
    ----------
    path : str
    dialect : Dialect
    columns : dict of str to tuple of str
        Cells by the name of the column, decimal points throughout.
    lines : tuple of int
        Line of the file of each row.
    """

    path: str
    dialect: Dialect
    columns: dict[str, tuple[str, ...]]
    lines: tuple[int, ...]


def read_text_table(
    path: str | Path,
    is_header: Callable[[Sequence[str]], bool],
    separator: str | None = None,
    decimal: str | None = None,
    header: int | None = None,
) -> TextTable:
    """Read a table, finding out what is not stated of its dialect.

    Parameters
    ----------
    path : str or Path
        UTF-8, or UTF-16 with a byte order mark.
    is_header : callable
        Of the cells of a line, whether they name the columns; the first such line does where `header` is not given.
    separator, decimal : str, optional
        Names in `SEPARATORS` and `DECIMALS`.
    header : int, optional
        Line of the names of columns, from 1.

    Returns
    -------
    TextTable

    Raises
    ------
    InputError
        A file that cannot be read or has no header, a row of another length, or decimals that are written both ways.
    """
    source = Path(path).as_posix()
    lines = _lines(path)
    kept = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith(_COMMENTS)]
    if not kept:
        raise InputError(source, "", "nothing but comments and blank lines", "a header and one row for each measurement")
    if header is None:
        separator, header = _header(kept, is_header, separator, source)
    else:
        stated = [line for number, line in kept if number == header]
        if not stated:
            raise InputError(source, f"line {header}", "no header", "the line that names the columns")
        separator = separator or _separator_of(stated[0])
    table = [(number, cells_of(line, separator, source, number)) for number, line in kept if number >= header]
    names, rows = table[0][1], table[1:]
    if twice := [name for name, times in Counter(names).items() if times > 1]:
        raise InputError(source, f"line {header}", f"column {twice[0]!r} twice", "each column once")
    for number, cells in rows:
        # A separator at the end of the rows and not of the header is common.
        if len(cells) == len(names) + 1 and not cells[-1]:
            cells.pop()
        if len(cells) != len(names):
            raise InputError(
                source, f"line {number}", f"{len(cells)} cells", f"{len(names)}, one for each column of line {header}"
            )
    if not rows:
        raise InputError(source, "", "a header alone", "one row for each measurement")
    decimal = decimal or _decimal_of(rows, separator, source)
    if decimal == "comma":
        rows = [(number, [_with_point(cell) for cell in cells]) for number, cells in rows]
    columns = dict(zip(names, zip(*(cells for _, cells in rows), strict=True), strict=True))
    return TextTable(source, Dialect(separator, decimal, header), columns, tuple(number for number, _ in rows))


def lines_of(text: str, path: str | Path) -> list[str]:
    """Lines of a file's text as editors count them; control characters and marks that turn the order of letters are refused."""
    lines = _ENDS.split(text)
    for number, line in enumerate(lines, 1):
        if character := steering(line.replace("\t", " ")):
            allowed = "printable characters, in UTF-8, or in UTF-16 with a byte order mark"
            raise InputError(path, f"line {number}", f"the character {character!a}", allowed)
    return lines[:-1] if lines[-1] == "" else lines


def _lines(path: str | Path) -> list[str]:
    content = read_bytes(path, LARGEST_BYTES, "a table with a line for each measurement")
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "utf-8")
    text = decoded(content, path, encoding)
    lines = lines_of(text, path)
    if len(lines) > MOST_LINES:
        allowed = f"at most {MOST_LINES} (the mean of a tracker's stream at each pose is one measurement)"
        raise InputError(path, "", f"{len(lines)} lines", allowed)
    return lines


def _header(
    kept: Sequence[tuple[int, str]], is_header: Callable[[Sequence[str]], bool], separator: str | None, source: str
) -> tuple[str, int]:
    for number, line in kept:
        for name in [separator] if separator else [name for name, mark in SEPARATORS.items() if mark in line]:
            if is_header(cells_of(line, name, source, number)):
                return name, number
    first = kept[0][1][:60]
    allowed = "columns x, y, z or such; --header LINE and --column x=NAME say which line and which columns they are"
    raise InputError(source, f"line {kept[0][0]}", repr(first), allowed)


def _separator_of(line: str) -> str:
    return next((name for name, mark in SEPARATORS.items() if mark in line), "comma")


def cells_of(line: str, separator: str, source: str, number: int) -> list[str]:
    """Cells of one line.

    Parameters
    ----------
    line : str
    separator : str
        A name in `SEPARATORS`, or the mark itself.
    source : str
        Named in errors.
    number : int
        Of the line.

    Returns
    -------
    list of str

    Raises
    ------
    InputError
        Quotes that are not in pairs, a cell of more than 100,000 characters.
    """
    mark = SEPARATORS.get(separator, separator)
    if mark == " ":
        return line.split()
    try:
        row = next(csv.reader([line], delimiter=mark, skipinitialspace=True, strict=True))
    except csv.Error as error:
        raise InputError(source, f"line {number}", str(error), "cells separated by one mark, quotes in pairs") from None
    return [cell.strip() for cell in row]


def _decimal_of(rows: Sequence[tuple[int, list[str]]], separator: str, source: str) -> str:
    if separator == "comma":
        return "point"
    seen: dict[str, tuple[int, str]] = {}
    for number, cells in rows:
        for cell in cells:
            for name, pattern in (("point", _POINT), ("comma", _COMMA)):
                if name not in seen and pattern.fullmatch(cell):
                    seen[name] = number, cell
        if len(seen) == 2:
            (one, left), (other, right) = seen["point"], seen["comma"]
            found = f"{left!r} in line {one} and {right!r} in line {other}"
            raise InputError(source, "", found, "one decimal mark; --decimal point or comma says which")
    return next(iter(seen), "point")


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell
