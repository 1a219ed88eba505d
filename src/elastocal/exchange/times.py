"""Times of measurements: numbers, dates, or times of day."""

import re
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import pandas as pd

from elastocal.campaigns.tables import Cells
from elastocal.io.texts import parse_number

# Upper bound on a number in a column of times; nanoseconds since 1970 are 2e18.
_LARGEST_TIME = 1e19
_TIME_OF_DAY = re.compile(
    r"([01]?[0-9]|2[0-3]):([0-5][0-9])(?::([0-5][0-9](?:[.,][0-9]+)?))?"
)
_DAY_S = 86400.0


def read_times(cells: Cells) -> np.ndarray:
    """Read the column ``time_s``, ndarray (N,), s.

    Times are numbers, or dates of ISO 8601, which count from 1970; a date without a
    time zone is in UTC. Times of day count from midnight; one that is more than half a
    day before the time above it belongs to the next day.
    """
    texts = cells.texts("time_s")
    numbers = [parse_number(text, _LARGEST_TIME) for text in texts]
    if None not in numbers:
        seconds = np.array(numbers, float) * cells.scales["time_s"]
        return cells.bounded("time_s", seconds)
    times_of_day = find_times_of_day(texts)
    if times_of_day:
        return _read_times_of_day(times_of_day)
    with suppress(ValueError, OverflowError):
        dates = pd.to_datetime(pd.Series(texts), format="ISO8601", utc=True)
        # Pandas reads plain numbers as years too.
        are_dates = all("-" in text or "/" in text for text in texts)
        if dates.notna().all() and are_dates:
            return (dates - pd.Timestamp(0, tz="UTC")).dt.total_seconds().to_numpy()
    is_usual_text = [find_times_of_day([text]) for text in texts]
    row = is_usual_text.index([]) if any(is_usual_text) else numbers.index(None)
    raise cells.fault(
        row,
        "time_s",
        "numbers, times as 10:20:33, or dates as 2023-05-04 10:20:33",
    )


def find_times_of_day(texts: Sequence[str]) -> list[tuple[str | None, ...]]:
    """Find hours, minutes and seconds of times of day; none unless all texts are such."""
    matches = [_TIME_OF_DAY.fullmatch(text) for text in texts]
    if None in matches:
        return []
    return [match.groups() for match in matches if match]


def _read_times_of_day(parts: list[tuple[str | None, ...]]) -> np.ndarray:
    """Return the seconds (N,) of hours, minutes and seconds since the first midnight."""
    clock_s = np.array(
        [
            3600.0 * float(hours or 0)
            + 60.0 * float(minutes or 0)
            + float((seconds or "0").replace(",", "."))
            for hours, minutes, seconds in parts
        ]
    )
    passes_midnight = np.diff(clock_s) < -0.5 * _DAY_S
    days = np.concatenate([[0], np.cumsum(passes_midnight)])
    return clock_s + _DAY_S * days
