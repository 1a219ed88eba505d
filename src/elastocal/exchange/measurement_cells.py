"""Cells of a table as numbers in SI units, with the line of what is none."""

import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from itertools import product

import numpy as np

from elastocal.campaigns.measurements import BOUNDS, find_beyond, show_cell
from elastocal.errors import InputError
from elastocal.exchange.column_names import ANGLE, FORCE, LENGTH, MOMENT, NONE, TEMPERATURE, TIME, UNITS, kind_of, unit_scale
from elastocal.exchange.csv_dialect import TextTable
from elastocal.io.texts import A_NUMBER, plain_number
from elastocal.mechanics.robot import Robot

# Of what has a usual unit; angles and lengths have two each and must be stated.
_USUAL = {FORCE: "N", MOMENT: "Nm", TIME: "s", TEMPERATURE: "C"}
_COVARIATES = ("time_s", "temperature_c", "u95_m")
# Nanoseconds since 1970 are 2e18.
_LARGEST_TIME = 1e19
# Without a unit, seconds since 1970 of the years 1990 to 2100 cannot be seconds, minutes or hours of a campaign in these.
_EPOCH_S = 6.3e8, 4.1e9
_HOURS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p")
# Dates of points and of slashes: who writes 05/04/2023 has to say which is the month.
_DATES, _ORDERS = ("%d.%m.%Y ", "%d.%m.%y "), {"day-first": "%d/%m/%Y ", "month-first": "%m/%d/%Y "}
_SLASHES = re.compile(r"(\d{1,2})[/-](\d{1,2})[/-]\d{4}\s.*", re.ASCII)
# To Python a time without a date is of this day.
_MIDNIGHT = datetime(1900, 1, 1, tzinfo=UTC)
# Of a pose, load, repeat or session; as in measurements.csv.
_LARGEST_ORDINAL = 2**31 - 1
# What programs write where nothing was measured.
_EMPTY = re.compile(r"|[+-]?nan(\(\w+\))?|[-–—]+|#?n/?a|n\.a\.|null|none", re.IGNORECASE)


def rows_with_position(text: TextTable, columns: Mapping[str, str], position: Sequence[str], skip_empty: bool) -> np.ndarray:
    """Rows that have a position; `skip_empty`: NaN, - and N/A are none either."""
    empty = _EMPTY.fullmatch if skip_empty else re.compile("").fullmatch
    filled = np.array([[not empty(cell) for cell in text.columns[columns[name]]] for name in position]).all(axis=0)
    if not filled.all() and not skip_empty:
        row = int(np.argmin(filled))
        of = f" of {text.columns[columns['target']][row]}" if "target" in columns else ""
        allowed = "three numbers, or --skip-empty to leave such rows out"
        raise InputError(text.path, f"line {text.lines[row]}", f"no position{of}", allowed)
    if not filled.any():
        raise InputError(text.path, "", "no position in any row", "at least one measurement")
    return np.flatnonzero(filled)


def find_units(
    text: TextTable,
    columns: Mapping[str, str],
    wanted: Sequence[str],
    stated: Mapping[str, str],
    given: Mapping[str, str],
    robot: Robot | None = None,
) -> dict[str, str]:
    """Units of wanted columns by their names: by options, by headers, or of what has a usual unit that one.

    `stated`: by headers. `given`: by options, ``angles`` and ``lengths`` for all that have no other. Raises `InputError`: no
    unit, or one of another kind.
    """
    found: dict[str, str] = {}
    for name in wanted:
        kinds = kind_of(name)
        if robot and len(kinds) > 1:
            kinds = (LENGTH if robot.chain.prismatic[int(name[1:]) - 1] else ANGLE,)
        if kinds == (NONE,):
            continue
        for_all = given.get("lengths" if kinds[0] == LENGTH else "angles")
        # Options go before headers, those for one column before those for all.
        unit = given.get(name) or stated.get(name) or _USUAL.get(kinds[0]) or for_all
        if unit is None:
            option = "--lengths mm" if kinds[0] == LENGTH else "--angles deg"
            raise InputError(text.path, "header", f"no unit of {columns[name]!r}", f"{option} or such, or --unit {name}=UNIT")
        if unit_scale(unit, kinds) is None:
            allowed = f"{', '.join(unit for kind in kinds for unit in UNITS[kind])}, by --unit {name}=UNIT"
            raise InputError(text.path, f"unit of {columns[name]!r}", repr(unit), allowed)
        found[name] = unit
    return found


class CellReader:
    """Cells as numbers in SI units, with the line of what is none."""

    def __init__(self, text: TextTable, columns: Mapping[str, str], units: dict[str, str], kept: np.ndarray) -> None:
        self.text, self.columns, self.units, self.kept = text, columns, units, kept

    def fault(self, index: int, name: str, allowed: str) -> InputError:
        """InputError of one cell; `index` counts the rows kept."""
        row = self.kept[index]
        header = self.columns[name]
        where = f"line {self.text.lines[row]}, column {header}"
        return InputError(self.text.path, where, show_cell(self.text.columns[header][row]), allowed)

    def cells(self, name: str) -> list[str]:
        """list of str (N,)."""
        cells = self.text.columns[self.columns[name]]
        return [cells[row] for row in self.kept]

    def times(self, name: str) -> np.ndarray:
        """ndarray (N,), s: as numbers, a time of day or a date; of dates since 1970, at Greenwich where no zone is stated."""
        cells = self.cells(name)
        numbers = [plain_number(cell, _LARGEST_TIME) for cell in cells]
        if None not in numbers:
            return self._bounded(name, np.array(numbers, float) * UNITS[TIME][self.units[name]])
        values = _clock_times(cells, self.units[name])
        if values is None:
            allowed = "numbers, times as 10:20:33 or dates as 2023-05-04 10:20:33, 04.05.2023 10:20 or 05/04/2023 10:20"
            raise self.fault(numbers.index(None), name, allowed)
        return values

    def numbers(self, name: str) -> np.ndarray:
        """ndarray (N,), SI units."""
        values = np.array([np.nan if (value := plain_number(cell)) is None else value for cell in self.cells(name)])
        if not np.isfinite(values).all():
            raise self.fault(int(np.argmin(np.isfinite(values))), name, A_NUMBER)
        unit = self.units.get(name)
        return self._bounded(name, values if unit is None else values * (unit_scale(unit, kind_of(name)) or 1.0))

    def _bounded(self, name: str, values: np.ndarray) -> np.ndarray:
        if (index := find_beyond(name, values)) is not None:
            raise self.fault(index, name, BOUNDS[name].allowed)
        return values

    def integers(self, name: str) -> np.ndarray:
        """ndarray of int (N,)."""
        values = self.numbers(name)
        wrong = (values != np.round(values)) | (np.abs(values) > _LARGEST_ORDINAL)
        if wrong.any():
            raise self.fault(int(np.argmax(wrong)), name, f"an integer, up to {_LARGEST_ORDINAL}")
        return values.astype(np.int64)


def covariates_of(
    read: CellReader, mapped: Mapping[str, str], stated: Mapping[str, str], given: Mapping[str, str], notes: list[str]
) -> dict[str, np.ndarray]:
    """Time, temperature and uncertainty; of the first two is left out, with a note, what nobody asked for and is no number.

    `mapped`: names of columns that options state. `stated`, `given`: units by headers and by options. `notes` is added to.
    """
    found = {}
    for name in _COVARIATES:
        if name not in read.columns:
            continue
        header, numbers = read.columns[name], [plain_number(cell, _LARGEST_TIME) for cell in read.cells(name)]
        is_time, text = name == "time_s", None in numbers
        order = _order_of_dates(read, given.get(name)) if is_time and text else None
        try:
            unit = order or stated.get(name) or given.get(name)
            if is_time and unit is None and (unit := _unit_of_epoch(numbers)):
                notes.append(f"{header!r} taken for {unit} since 1970")
            named = {**given, **({name: unit} if unit else {})}
            read.units |= {name: order} if order else find_units(read.text, read.columns, [name], stated, named)
            found[name] = read.times(name) if is_time else read.numbers(name)
            if unit is None and not text:
                notes.append(f"{header!r} in {read.units[name]}, as nothing states a unit")
            if is_time and text:
                notes.append(f"{header!r} read as times of day or dates, such as {read.cells(name)[0]!r}, in s")
        except InputError as error:
            if name in mapped or name in given or name == "u95_m" or not text:
                raise InputError(error.source, error.key, error.found, f"{error.allowed}, or --ignore {header!r}") from None
            read.units.pop(name, None)
            notes.append(f"{header!r} not read: {error.key} has {error.found}")
    return found


def _unit_of_epoch(numbers: Sequence[float | None]) -> str | None:
    """Unit in which all numbers are times of this age since 1970, which no campaign lasts; None where they are not."""
    values = np.array([number or 0.0 for number in numbers])
    low, high = values.min(), values.max()
    return next(
        (u for u in ("ms", "us", "ns") if _EPOCH_S[0] <= low * UNITS[TIME][u] and high * UNITS[TIME][u] <= _EPOCH_S[1]), None
    )


def _order_of_dates(read: CellReader, stated: str | None) -> str | None:
    """Whether day or month is first in dates such as 11/27/2026, one of `_ORDERS`; None where a cell is none of these.

    Raises `InputError`: dates that may be read either way, and nothing states which.
    """
    parts = [_SLASHES.fullmatch(cell) for cell in read.cells("time_s")]
    if not all(parts) or stated in _ORDERS:
        return stated if all(parts) else None
    first, second = np.array([(int(part[1]), int(part[2])) for part in parts if part]).max(axis=0)
    if first <= 12 and second <= 12:
        allowed = f"dates of one meaning: --unit time_s={' or '.join(_ORDERS)} says it, or --ignore {read.columns['time_s']!r}"
        raise read.fault(0, "time_s", allowed)
    return "month-first" if first <= 12 else "day-first"


def _clock_times(cells: Sequence[str], order: str) -> np.ndarray | None:
    """Seconds of times or dates, all written in one way, ndarray (N,), on over midnight; None where they are none.

    `order`: of dates with slashes, one of `_ORDERS`, if it is one of them.
    """
    try:
        dates = [datetime.fromisoformat(cell.replace("/", "-")) for cell in cells if "-" in cell or "/" in cell]
        if len(dates) == len(cells) and len({date.tzinfo is None for date in dates}) == 1:
            return np.array([(date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp() for date in dates])
    except ValueError:
        pass
    plain = [cell.replace("-", "/").replace(", ", " ").replace(",", ".") for cell in cells]
    for day, hour in product(("", *_DATES, _ORDERS.get(order, _DATES[0])), _HOURS):
        try:
            times = [datetime.strptime(cell, day + hour).replace(tzinfo=UTC) for cell in plain]
        except ValueError:
            continue
        if day:
            return np.array([time.timestamp() for time in times])
        seconds = np.array([(time - _MIDNIGHT).total_seconds() for time in times])
        return seconds + 86400.0 * np.concatenate([[0], np.cumsum(np.diff(seconds) < -43200.0)])
    return None
