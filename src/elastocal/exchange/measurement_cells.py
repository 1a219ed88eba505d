"""Cells of a table as numbers in SI units, with the line of what is none."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np

from elastocal.campaigns.column_bounds import BOUNDS, find_beyond
from elastocal.campaigns.measurements import show_cell
from elastocal.errors import InputError
from elastocal.exchange.column_meanings import find_units
from elastocal.exchange.column_names import COVARIATES, TIME, UNITS, kind_of, unit_scale
from elastocal.exchange.csv_dialect import TextTable
from elastocal.io.texts import A_NUMBER, plain_number

# Nanoseconds since 1970 are 2e18.
_LARGEST_TIME = 1e19
# Without a unit, seconds since 1970 of the years 1990 to 2100 cannot be seconds, minutes or hours of a campaign in these.
_EPOCH_S = 6.3e8, 4.1e9
_CLOCKS = ("%H:%M:%S.%f", "%H:%M:%S", "%H:%M", "%I:%M:%S %p", "%I:%M %p")
_DATES = ("%d.%m.%Y %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M")
# To Python a time without a date is of this day.
_MIDNIGHT = datetime(1900, 1, 1, tzinfo=UTC)
# Of a pose, load, repeat or session; as in measurements.csv.
_LARGEST_ORDINAL = 2**31 - 1


def rows_with_position(text: TextTable, columns: Mapping[str, str], position: Sequence[str], skip_empty: bool) -> np.ndarray:
    """Rows that have a position."""
    filled = np.array([[bool(cell) for cell in text.columns[columns[name]]] for name in position]).all(axis=0)
    if not filled.all() and not skip_empty:
        row = int(np.argmin(filled))
        of = f" of {text.columns[columns['target']][row]}" if "target" in columns else ""
        allowed = "three numbers, or --skip-empty to leave such rows out"
        raise InputError(text.path, f"line {text.lines[row]}", f"no position{of}", allowed)
    if not filled.any():
        raise InputError(text.path, "", "no position in any row", "at least one measurement")
    return np.flatnonzero(filled)


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
        if None in numbers:
            values = _clock_times(cells)
            if values is None:
                allowed = "numbers, times as 10:20:33 or dates as 2023-05-04 10:20:33 (05/04/2023 may be two days)"
                raise self.fault(numbers.index(None), name, allowed)
            return values
        values = np.array(numbers, float) * UNITS[TIME][self.units[name]]
        if (index := find_beyond(name, values)) is not None:
            raise self.fault(index, name, BOUNDS[name].allowed)
        return values

    def unit_of_epoch(self, name: str) -> str | None:
        """Unit in which all numbers are times of this age since 1970, which no campaign lasts; None where they are not."""
        values = np.array([plain_number(cell, _LARGEST_TIME) or 0.0 for cell in self.cells(name)])
        for unit in ("ms", "us", "ns"):
            seconds = values * UNITS[TIME][unit]
            if _EPOCH_S[0] <= seconds.min() and seconds.max() <= _EPOCH_S[1]:
                return unit
        return None

    def numbers(self, name: str) -> np.ndarray:
        """ndarray (N,), SI units."""
        cells = self.cells(name)
        values = np.array([np.nan if (value := plain_number(cell)) is None else value for cell in cells])
        if not np.isfinite(values).all():
            raise self.fault(int(np.argmin(np.isfinite(values))), name, A_NUMBER)
        unit = self.units.get(name)
        values = values if unit is None else values * (unit_scale(unit, kind_of(name)) or 1.0)
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
    for name in COVARIATES:
        if name not in read.columns:
            continue
        text = any(plain_number(cell, _LARGEST_TIME) is None for cell in read.cells(name))
        try:
            unit = stated.get(name) or given.get(name)
            if name == "time_s" and unit is None and (unit := read.unit_of_epoch(name)):
                notes.append(f"{read.columns[name]!r} taken for {unit} since 1970")
            read.units |= find_units(read.text, read.columns, [name], stated, {**given, **({name: unit} if unit else {})})
            found[name] = read.times(name) if name == "time_s" else read.numbers(name)
            if unit is None and not text:
                notes.append(f"{read.columns[name]!r} in {read.units[name]}, as nothing states a unit")
            if name == "time_s" and text:
                notes.append(f"{read.columns[name]!r} read as times of day or dates, such as {read.cells(name)[0]!r}, in s")
        except InputError as error:
            if name in mapped or name in given or name == "u95_m" or not text:
                allowed = f"{error.allowed}, or --ignore {read.columns[name]!r}"
                raise InputError(error.source, error.key, error.found, allowed) from None
            read.units.pop(name, None)
            notes.append(f"{read.columns[name]!r} not read: {error.key} has {error.found}")
    return found


def _clock_times(cells: Sequence[str]) -> np.ndarray | None:
    """Seconds of times or dates, all written in one way, ndarray (N,), on over midnight; None where they are none."""
    try:
        dates = [datetime.fromisoformat(cell.replace("/", "-")) for cell in cells if "-" in cell or "/" in cell]
        if len(dates) == len(cells) and len({date.tzinfo is None for date in dates}) == 1:
            return np.array([(date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp() for date in dates])
    except ValueError:
        return None
    for written in (*_CLOCKS, *_DATES):
        try:
            times = [datetime.strptime(cell, written).replace(tzinfo=UTC) for cell in cells]
        except ValueError:
            continue
        if written in _DATES:
            return np.array([time.timestamp() for time in times])
        seconds = np.array([(time - _MIDNIGHT).total_seconds() for time in times])
        return seconds + 86400.0 * np.concatenate([[0], np.cumsum(np.diff(seconds) < -43200.0)])
    return None
