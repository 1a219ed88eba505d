"""Tables of numbers as text, in whatever dialect: encoding, separator, decimal mark, lines before the header, comments."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from elastocal.counting import counted
from elastocal.errors import InputError, closest_first, steering
from elastocal.io.texts import decoded, read_bytes

# In this order: a header that holds a semicolon is not separated by its commas.
SEPARATORS = {"tab": "\t", "semicolon": ";", "bar": "|", "comma": ",", "space": " "}
DECIMALS = {"point": ".", "comma": ","}
# What may stand between groups of three digits: a space is any that people see as one.
THOUSANDS = {"point": ".", "comma": ",", "space": " \u00a0\u2009\u202f", "apostrophe": "'\u2019"}
_MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
# What Western spreadsheets and instruments write beyond ASCII. Another encoding that gives these alone is not to be expected:
# that of Windows is taken where a file is no UTF-8, and asked for where anything else comes out.
_WESTERN, _WESTERN_SIGNS = "cp1252", frozenset("°µ±²³·äöüÄÖÜßàâçèéêëîïôùûñÉ\u00a0")
_COMMENTS = ("#", "%", "//")
_POINT = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)
# A number with marks between its thousands for certain: other marks than the decimal one, or several.
_GROUPED = re.compile(
    r"[+-]?\d{1,3}(?:(?:[ \u00a0\u2009\u202f'\u2019]\d{3})+(?:[.,]\d*)?"
    r"|(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,})",
    re.ASCII,
)
# What may be one, looked at quickly; a comma before three digits may be either.
_MARKED = re.compile("[ \u00a0\u2009\u202f'\u2019,]|[.].*[.]")
_EITHER = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}", re.ASCII)
_ENDS = re.compile(r"\r\n|\n|\r")
# The whole of it is in memory, as text and as cells: some 2 GB at most.
LARGEST_BYTES, MOST_LINES = 100_000_000, 500_000


@dataclass(frozen=True)
class Dialect:
    """How a table is written; what is None is found out, or refused where it is ambiguous.

    `separator`, `decimal`: names in `SEPARATORS` and `DECIMALS`. `header`: line of the names of columns, from 1. `encoding`: as
    Python calls it. `thousands`: name in `THOUSANDS` of the mark between thousands; None for none.
    """

    separator: str | None = None
    decimal: str | None = None
    header: int | None = None
    encoding: str | None = None
    thousands: str | None = None


_UNSTATED = Dialect()
_WANTED = "columns x, y, z or such; --header LINE and --column x=NAME say which line and which columns they are"


@dataclass(frozen=True)
class TextTable:
    """Cells of a table: decimal points throughout, no marks between thousands; `lines` has the line of the file of each row.

    `units`: of the columns that have one in a row of units under the header. `left_out` says in words what of the file is no
    cell of `columns`.
    """

    path: str
    dialect: Dialect
    columns: dict[str, tuple[str, ...]]
    lines: tuple[int, ...]
    left_out: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)


def read_text_table(
    path: str | Path,
    is_header: Callable[[Sequence[str]], bool],
    stated: Dialect = _UNSTATED,
    ignored: Collection[str] = (),
    wanted: str = _WANTED,
    units_in: Callable[[Sequence[str]], Sequence[str] | None] = lambda cells: None,
) -> TextTable:
    """Read a table, finding out what is not stated of its dialect.

    Columns without a name are called ``column 3`` by their place; those of empty cells are left out, and so are such rows.
    Names that several columns have are taken with what stands above them, as of the marker of three columns X, Y, Z.

    `is_header`: of the cells of a line, whether they name the columns; the first such line does where no line is stated, else
    one behind a comment mark. `wanted`: what a header has, for messages. `ignored`: names of columns that are left out whatever
    they hold. `units_in`: the units of a row of cells that is nothing but units, such as one under the header. Raises
    `InputError`: a file that cannot be read or has no header, a row of another length, or numbers that may be read in two ways.
    """
    source = Path(path).as_posix()
    lines, encoding = _read_lines(path, stated.encoding)
    filled = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    kept = [(number, line) for number, line in filled if not line.lstrip().startswith(_COMMENTS)]
    comments = [(number, line.lstrip().lstrip("#%/").strip()) for number, line in filled if line.lstrip().startswith(_COMMENTS)]
    if not kept:
        raise InputError(source, "", "nothing but comments and blank lines", "a header and one row for each measurement")
    separator, header, line = _find_header(kept, comments, is_header, stated, wanted, source)
    table = [(number, _split_cells(line, separator, source, number)) for number, line in kept if number > header]
    names, named_above = _read_names(_split_cells(line, separator, source, header), kept, separator, header)
    rows = [row for row in table if any(row[1])]
    for number, cells in rows:
        # Separators at the end of the rows and not of the header are common.
        while len(cells) > len(names) and not cells[-1]:
            cells.pop()
        if len(cells) != len(names):
            allowed = f"{len(names)}, one for each column of line {header}"
            raise InputError(source, f"line {number}", counted(len(cells), "cell"), allowed)
    units = dict(zip(names, (rows and units_in(rows[0][1])) or (), strict=False))
    rows = rows[1:] if units else rows
    if not rows:
        raise InputError(source, "", "a header alone", "one row for each measurement")
    for name in ignored:
        if name not in names:
            allowed = closest_first(name, list(dict.fromkeys(names)))
            raise InputError(source, f"line {header}", f"no column {name!r} to ignore", allowed)
    cells_by_place = list(zip(*(cells for _, cells in rows), strict=True))
    places = [
        place
        for place, name in enumerate(names)
        if name not in ignored and (name != f"column {place + 1}" or any(cells_by_place[place]))
    ]
    if twice := [name for name, times in Counter(names[place] for place in places).items() if times > 1]:
        allowed = f"each column once (import csv --ignore {twice[0]!r} leaves out those that nobody needs)"
        raise InputError(source, f"line {header}", f"column {twice[0]!r} twice", allowed)
    numbers = [number for number, _ in rows]
    columns = {names[place]: cells_by_place[place] for place in places}
    thousands = stated.thousands
    if thousands is not None and thousands == stated.decimal:
        raise InputError("--thousands", "", f"{thousands}, the decimal mark too", "two different marks")
    if thousands is not None:
        columns = {name: tuple(_remove_thousands(cell, thousands) for cell in cells) for name, cells in columns.items()}
    decimal = stated.decimal or _find_decimal(columns, numbers, separator, thousands, source)
    if decimal == "comma":
        columns = {name: tuple(map(_write_point, cells)) for name, cells in columns.items()}
    unread = (
        (len(table) - len(rows) - bool(units), "row", "of empty cells"),
        (sum(number < header for number, _ in filled) - named_above, "line", "above the header"),
        (sum(number > header for number, _ in comments), "line", "of comments below the header"),
        (len(names) - len(places) - sum(name in ignored for name in names), "column", "without name and values"),
    )
    left_out = tuple(f"{counted(number, noun)} {where}" for number, noun, where in unread if number)
    dialect = Dialect(separator, decimal, header, encoding, thousands)
    stated_units = {name: unit for name, unit in units.items() if unit and name in columns}
    return TextTable(source, dialect, columns, tuple(numbers), left_out, stated_units)


def _read_names(cells: Sequence[str], kept: Sequence[tuple[int, str]], separator: str, header: int) -> tuple[list[str], bool]:
    """Names of columns, and whether some are of two lines: those that stand there twice, by what the line above has there."""
    names = [name or f"column {place}" for place, name in enumerate(cells, 1)]
    above = next((line for number, line in reversed(kept) if number < header), "")
    twice = {name for name, times in Counter(names).items() if times > 1}
    if not twice or separator == "space":
        return names, False
    of, groups = "", _try_cells(above, separator)
    both = []
    for name, group in zip(names, [*groups, *[""] * (len(names) - len(groups))], strict=False):
        # Of cells that a spreadsheet joined the first one has the text.
        of = group or of
        both.append(f"{of} {name}" if name in twice and of else name)
    return (both, True) if len(set(both)) == len(both) else (names, False)


def _split_lines(text: str, path: str | Path) -> list[str]:
    """Lines of a file's text as editors count them; control characters and marks that turn the order of letters are refused."""
    lines = _ENDS.split(text)
    for number, line in enumerate(lines, 1):
        if character := steering(line.replace("\t", " ")):
            allowed = "printable characters, in UTF-8, or in UTF-16 with a byte order mark"
            raise InputError(path, f"line {number}", f"the character {character!a}", allowed)
    return lines[:-1] if lines[-1] == "" else lines


def _read_lines(path: str | Path, encoding: str | None) -> tuple[list[str], str]:
    content = read_bytes(path, LARGEST_BYTES, "a table with a line for each measurement")
    text, encoding = _decode(content, path, encoding)
    lines = _split_lines(text, path)
    if len(lines) > MOST_LINES:
        allowed = f"at most {MOST_LINES} (the mean of a tracker's stream at each pose is one measurement)"
        raise InputError(path, "", counted(len(lines), "line"), allowed)
    return lines, encoding


def _decode(content: bytes, path: str | Path, encoding: str | None) -> tuple[str, str]:
    """Text of a file and its encoding, found out where it is not stated."""
    if encoding is not None:
        try:
            return decoded(content, path, encoding).removeprefix("\ufeff"), encoding
        except InputError:
            raise
        except (LookupError, ValueError) as error:
            known = "an encoding as Python calls it, such as utf-8, cp1252, cp437, mac-roman, shift_jis, gb18030 or utf-16-le"
            raise InputError("--encoding", "", f"{encoding!r}: {error}", known) from None
    if mark := next((name for mark, name in _MARKS if content.startswith(mark)), None):
        return decoded(content, path, mark), mark
    # In UTF-16 every other byte of digits, letters and separators is zero.
    for name, zeros, letters in (
        ("utf-16-le", content[1:200:2], content[:200:2]),
        ("utf-16-be", content[:200:2], content[1:200:2]),
    ):
        if zeros and not any(zeros) and all(letters):
            return decoded(content, path, name), name
    try:
        return decoded(content, path, "utf-8"), "utf-8"
    except InputError as error:
        western = content.decode(_WESTERN, errors="replace")
        if all(character in _WESTERN_SIGNS for character in western if not character.isascii()):
            return western, _WESTERN
        allowed = "UTF-8 (iconv -f cp1252 -t utf-8), or in import csv --encoding cp1252, shift_jis, gb18030 or such"
        raise InputError(path, error.key, error.found, allowed) from None


def _find_header(
    kept: Sequence[tuple[int, str]],
    comments: Sequence[tuple[int, str]],
    is_header: Callable[[Sequence[str]], bool],
    stated: Dialect,
    wanted: str,
    source: str,
) -> tuple[str, int, str]:
    """Separator, and number and text of the line that names the columns."""
    if stated.header is not None:
        line = dict((*kept, *comments)).get(stated.header)
        if not line:
            raise InputError(source, f"line {stated.header}", "no header", "the line that names the columns")
        usual = next((name for name, mark in SEPARATORS.items() if mark in line), "comma")
        return stated.separator or usual, stated.header, line

    def separator_of(line: str, cells: Callable[[str, str], list[str]]) -> str | None:
        tried = [stated.separator] if stated.separator else [name for name, mark in SEPARATORS.items() if mark in line]
        return next((name for name in tried if is_header(cells(line, name))), None)

    for number, line in kept:
        if separator := separator_of(line, lambda line, name: _split_cells(line, name, source, number)):  # noqa: B023
            return separator, number, line
    found = [(separator, number, line) for number, line in comments if (separator := separator_of(line, _try_cells))]
    if len({line for _, _, line in found}) > 1:
        allowed = "--header LINE, the one that names the columns"
        raise InputError(source, f"line {found[0][1]} and line {found[1][1]}", "two headers behind comment marks", allowed)
    if found:
        return found[0]
    first = kept[0][1][:60]
    raise InputError(source, f"line {kept[0][0]}", repr(first), wanted)


def _try_cells(line: str, separator: str) -> list[str]:
    """Cells of a comment, in which quotes need not be in pairs."""
    try:
        return _split_cells(line, separator, "", 0)
    except InputError:
        return []


def _split_cells(line: str, separator: str, source: str, number: int) -> list[str]:
    """Cells of one line; quotes that are not in pairs and a cell of more than 100,000 characters are refused."""
    mark = SEPARATORS[separator]
    if mark == " ":
        if '"' not in line:
            return line.split()
        line = " ".join(line.split("\t")).strip()
    try:
        row = next(csv.reader([line], delimiter=mark, skipinitialspace=True, strict=True))
    except csv.Error as error:
        raise InputError(source, f"line {number}", str(error), "cells separated by one mark, quotes in pairs") from None
    return [cell.strip() for cell in row]


def _find_decimal(
    columns: dict[str, tuple[str, ...]], lines: Sequence[int], separator: str, thousands: str | None, source: str
) -> str:
    """The decimal mark that all numbers have; refused are numbers that may be read in two ways."""
    seen: dict[str, tuple[int, str]] = {}
    sure = False
    for place, number in enumerate(lines):
        for cells in columns.values():
            cell = cells[place]
            marked = _MARKED.search(cell)
            if not marked and ("." not in cell or "point" in seen):
                continue
            if marked and thousands is None and _GROUPED.fullmatch(cell):
                allowed = (
                    "numbers without marks between thousands; --thousands comma, point, space or apostrophe, where it is one"
                )
                raise InputError(source, f"line {number}", repr(cell), allowed)
            for name, pattern in (("point", _POINT), ("comma", _COMMA)):
                if pattern.fullmatch(cell):
                    seen.setdefault(name, (number, cell))
                    sure |= name == "comma" and not _EITHER.fullmatch(cell)
        if len(seen) == 2:
            (one, left), (other, right) = seen["point"], seen["comma"]
            found = f"{left!r} in line {one} and {right!r} in line {other}"
            allowed = "one decimal mark: --decimal point or comma says which, --thousands that the other is none"
            raise InputError(source, "", found, allowed)
    decimal = next(iter(seen), "comma" if thousands == "point" else "point")
    if decimal == thousands:
        number, cell = seen[decimal]
        allowed = f"three digits behind each {decimal}, as it is between thousands"
        raise InputError(source, f"line {number}", repr(cell), allowed)
    if "comma" in seen and (separator == "comma" or not sure):
        number, cell = seen["comma"]
        allowed = "--decimal comma where the comma is the decimal mark, or --thousands comma"
        raise InputError(source, f"line {number}", repr(cell), allowed)
    return decimal


def _remove_thousands(cell: str, thousands: str) -> str:
    marks = re.escape(THOUSANDS[thousands])
    grouped = re.fullmatch(rf"[+-]?\d{{1,3}}(?:[{marks}]\d{{3}})+(?:[.,]\d*)?", cell, re.ASCII)
    return re.sub(f"[{marks}]", "", cell) if grouped else cell


def _write_point(cell: str) -> str:
    return cell.replace(",", ".") if _COMMA.fullmatch(cell) else cell
