"""Options that state quantities: lengths with their unit, and lists of numbers."""

from __future__ import annotations

import re

import numpy as np

from elastocal.errors import InputError

_METRES = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "m": 1.0}
_LENGTH = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(mm|um|µm|m)")
# No instrument repeats better than the least (`fitting.noise.FINEST`); no accuracy, noise or tolerance of a robot is larger.
_LEAST_M, _LARGEST_M = 1e-8, 0.1
# Of a mass, over the mass, as in a robot file.
LARGEST_RELATIVE_STD = 100.0
# Trackers stand at up to a hundred metres, targets within an arm's reach of where they are fixed, as in a campaign.
FARTHEST_PLACE_M, FARTHEST_TARGET_M = 1e3, 10.0
# Draws are numbered in 32 bits; more poses, rows, lines or jobs than these are slips of the keyboard.
LARGEST_SEED, MOST_POSES, MOST_ROWS, MOST_JOBS = 2**32 - 1, 10_000, 10_000_000, 10_000


def length_m(option: str, text: str) -> float:
    """A length with its unit in metres.

    Parameters
    ----------
    option : str
        Named in errors.
    text : str
        Such as ``0.2mm``.

    Returns
    -------
    float

    Raises
    ------
    InputError
        No unit, less than any instrument tells, or more than any robot misses by.
    """
    match = _LENGTH.fullmatch(text.strip())
    value = float(match[1]) * _METRES[match[2]] if match else 0.0
    if not _LEAST_M <= value <= _LARGEST_M:
        allowed = f"a length with its unit such as 0.2mm or 60um, {1e6 * _LEAST_M:g} um to {_LARGEST_M:g} m"
        raise InputError(option, "", repr(text), allowed)
    return value


def numbers(option: str, text: str, count: int, largest: float = FARTHEST_PLACE_M) -> np.ndarray:
    """Numbers separated by commas, metres.

    Parameters
    ----------
    option : str
        Named in errors.
    text : str
    count : int
    largest : float
        Size that each may have.

    Returns
    -------
    ndarray (count,)

    Raises
    ------
    InputError
        Another count, or something that is no number of such a size.
    """
    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.zeros(0)
    # Not a number is no more than anything either.
    if len(found) != count or not (np.abs(found) <= largest).all():
        raise InputError(option, "", repr(text), f"{count} numbers separated by commas, each up to {largest:g} m")
    return found
