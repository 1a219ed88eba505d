"""What an audit finds: each check of a file is one row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

# Two programs that do the same in double precision, in another order.
ROUNDING = 1e-9
# Columns kept in single precision.
SINGLE = 1e-5
# Tables are written with nine digits.
NINE_DIGITS = 5.1e-9


@dataclass(frozen=True)
class Finding:
    """One check of one file.

    `checked`: what was looked at. `by`: the independent path. `compared`: how many values. `worst`: largest difference over
    what is allowed; a check holds up to 1. `note`: where a check does not hold: what was found and what was expected. `file`:
    empty of the file that is being audited.
    """

    checked: str
    by: str
    compared: int
    worst: float
    note: str = ""
    file: str = ""

    @property
    def holds(self) -> bool:
        """Whether no value is further off than allowed."""
        return bool(self.worst <= 1.0)


def compare(
    checked: str,
    by: str,
    found: object,
    expected: object,
    relative: float = ROUNDING,
    absolute: float = 0.0,
    scale: object = None,
) -> Finding:
    """Values of a file beside those of an independent path.

    Not a number in both counts as equal. `relative`: allowed difference over the scale, which is the largest expected value
    where none is given. `absolute`: allowed beside it.
    """
    left, right = (np.asarray(each, float).ravel() for each in (found, expected))
    if left.shape != right.shape:
        return Finding(checked, by, len(right), np.inf, f"found {len(left)} values, expected {len(right)}")
    if not len(left):
        return Finding(checked, by, 0, 0.0)
    same = (left == right) | (np.isnan(left) & np.isnan(right))
    largest = np.max(np.abs(right[np.isfinite(right)]), initial=0.0)
    allowed = absolute + relative * (largest if scale is None else np.abs(np.asarray(scale, float)).ravel())
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.where(same, 0.0, np.abs(left - right) / allowed)
    # Not a number beside a number, or a difference where none is allowed.
    off = np.where(np.isnan(off), np.inf, off)
    place = int(np.argmax(off))
    note = "" if off[place] <= 1 else f"value {place}: found {left[place]:.9g}, expected {right[place]:.9g}"
    return Finding(checked, by, len(left), float(off[place]), note)


def require(checked: str, by: str, holds: Any, note: str = "", count: int = 1) -> Finding:
    """A statement about so many values that holds or does not; the note is for where it does not."""
    return Finding(checked, by, count, 0.0 if holds else np.inf, "" if holds else note)


def require_each_once(frame: pd.DataFrame, **ranges: Iterable[int]) -> Finding:
    """Whether rows are numbered by all combinations of ranges, the last one changing fastest."""
    expected = pd.MultiIndex.from_product([*ranges.values()]).to_frame()
    checked = f"each {' and '.join(ranges).replace('_', ' ')} once"
    return compare(checked, "counting", frame[list(ranges)], expected, 0.0)


def compare_columns(
    stored: pd.DataFrame,
    expected: pd.DataFrame,
    keys: Iterable[str],
    by: str = "pandas",
    relative: float = NINE_DIGITS,
    absolute: float = 0.0,
) -> Iterator[Finding]:
    """A table beside the same made again, column by column; the last finding says how many cells were followed.

    Rows go together by the words of their keys, in any order. Columns that the second lacks, and cells that are NA there, are
    not compared. `relative`: allowed difference of each number over itself.
    """
    names = [*keys]
    left, right = (_with_names(frame, names) for frame in (stored, expected))
    twice = [name for each in (left, right) for name in each.index[each.index.duplicated()]]
    odd = sorted(set(left.index) ^ set(right.index)) + twice
    note = f"row {', '.join(odd[:1])} is in only one of both, or twice"
    yield require("rows", by, not odd, note, len(right))
    if odd:
        return
    left, followed = left.loc[right.index], len(right) * len(names)
    columns = [name for name in left if name in right and name not in names]
    for name in columns:
        kept = np.array([value is not pd.NA for value in right[name]], bool)
        found, wanted = left[name][kept], right[name][kept]
        followed += int(kept.sum())
        if {found.dtype.kind, wanted.infer_objects().dtype.kind} <= set("iuf"):
            scale = np.nan_to_num(np.abs(wanted.to_numpy(float)), posinf=0.0)
            yield compare(f"column {name}", by, found, wanted, relative, absolute, scale)
        else:
            pairs = zip(found.index, map(_word, found), map(_word, wanted), strict=True)
            off = [f"{row}: {one}, expected {other}" for row, one, other in pairs if one != other]
            yield require(f"column {name}", by, not off, ", ".join(off[:1]), len(found))
    rest = ", ".join(str(name) for name in stored if name not in (*columns, *names))
    yield Finding(f"{followed} of {stored.size} cells followed{'; not ' * bool(rest)}{rest}", by, 0, 0.0)


def _with_names(frame: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """The rows under the words of their keys, numbers to six digits."""
    return frame.set_axis(pd.Index([", ".join(map(_word, row)) for row in frame[keys].itertuples(index=False)], dtype=object))


def _word(value: object) -> str:
    if isinstance(value, float | np.floating):
        return "" if np.isnan(value) else f"{value:.6g}"
    return "" if value is None else str(value)
