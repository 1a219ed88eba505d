"""What an audit finds: each check of a file is one row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Two programs that do the same in double precision, in another order.
ROUNDING = 1e-9
# Columns kept in single precision.
SINGLE = 1e-5


@dataclass(frozen=True)
class Finding:
    """One check of one file.

    `checked`: what was looked at. `by`: the independent path. `compared`: how many values. `worst`: largest difference over
    what is allowed; a check holds up to 1. `note`: where a check does not hold: what was found and what was expected.
    """

    file: str
    checked: str
    by: str
    compared: int
    worst: float
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether no value is further off than allowed."""
        return bool(self.worst <= 1.0)


def compared(
    file: str,
    checked: str,
    by: str,
    found: object,
    expected: object,
    relative: float = ROUNDING,
    absolute: float = 0.0,
    scale: object = None,
) -> Finding:
    """Values of a file beside those of an independent path.

    `found`, `expected`: not a number in both counts as equal. `relative`: allowed difference over the scale. `absolute`:
    allowed beside it. `scale`: the largest expected value where none is given.
    """
    left, right = (np.asarray(each, float).ravel() for each in (found, expected))
    if left.shape != right.shape:
        return Finding(file, checked, by, len(right), np.inf, f"found {len(left)} values, expected {len(right)}")
    if not len(left):
        return Finding(file, checked, by, 0, 0.0)
    same = (left == right) | (np.isnan(left) & np.isnan(right))
    largest = np.max(np.abs(right[np.isfinite(right)]), initial=0.0)
    allowed = absolute + relative * (largest if scale is None else np.abs(np.asarray(scale, float)).ravel())
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.where(same, 0.0, np.abs(left - right) / allowed)
    # Not a number beside a number, or a difference where none is allowed.
    off = np.where(np.isnan(off), np.inf, off)
    place = int(np.argmax(off))
    worst = float(off[place])
    note = "" if worst <= 1 else f"value {place}: found {left[place]:.9g}, expected {right[place]:.9g}"
    return Finding(file, checked, by, len(left), worst, note)


def held(file: str, checked: str, by: str, holds: bool, note: str, compared_values: int = 1) -> Finding:
    """A statement that holds or does not.

    `note`: said where it does not.
    """
    return Finding(file, checked, by, compared_values, 0.0 if holds else np.inf, "" if holds else note)
