"""Options that state quantities: lengths with their unit, and lists of numbers."""

from __future__ import annotations

import re

import numpy as np

from elastocal.errors import InputError

_METRES = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "m": 1.0}
_LENGTH = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(mm|um|µm|m)")
# No accuracy, noise or tolerance of a robot is larger.
_LARGEST_M = 0.1


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
        No unit, nothing, or more than any robot misses by.
    """
    match = _LENGTH.fullmatch(text.strip())
    value = float(match[1]) * _METRES[match[2]] if match else 0.0
    if not 0.0 < value <= _LARGEST_M:
        raise InputError(option, "", repr(text), f"a length with its unit such as 0.2mm or 60um, up to {_LARGEST_M:g} m")
    return value


def numbers(option: str, text: str, count: int) -> np.ndarray:
    """Numbers separated by commas.

    Parameters
    ----------
    option : str
        Named in errors.
    text : str
    count : int

    Returns
    -------
    ndarray (count,)

    Raises
    ------
    InputError
        Another count, or something that is no finite number.
    """
    try:
        found = np.array([float(part) for part in text.split(",")])
    except ValueError:
        found = np.zeros(0)
    if len(found) != count or not np.isfinite(found).all():
        raise InputError(option, "", repr(text), f"{count} numbers separated by commas")
    return found
