"""What an audit finds: each check of a file is one row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Iterable

# Two programs that do the same in double precision, in another order.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Finding:
    """One check of one file.

    `checked`: what was looked at. `by`: the independent path. `compared`: how many values. `worst`: largest difference over
    what is allowed; a check holds up to 1. `note`: where a check does not hold: what was found and what was expected.
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
    checked: str, by: str, found: object, expected: object, relative: float = ROUNDING, absolute: float = 0.0
) -> Finding:
    """Values of a file beside those of an independent path; not a number in both counts as equal.

    `relative`: allowed difference over the largest expected value. `absolute`: allowed beside it.
    """
    left, right = (np.asarray(each, float).ravel() for each in (found, expected))
    if left.shape != right.shape:
        return Finding(checked, by, len(right), np.inf, f"found {len(left)} values, expected {len(right)}")
    if not len(left):
        return Finding(checked, by, 0, 0.0)
    same = (left == right) | (np.isnan(left) & np.isnan(right))
    allowed = absolute + relative * np.max(np.abs(right[np.isfinite(right)]), initial=0.0)
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
