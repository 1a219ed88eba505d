"""Check arguments that a caller passes. A wrong one is an InputError of one line."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def check_array(
    source: str,
    argument: str,
    values: ArrayLike | None,
    shape: tuple[int | None, ...],
    kind: type | None = float,
) -> np.ndarray:
    """Check the shape of an array; None stands for any length.

    Parameters
    ----------
    source, argument : what is called with the array, and the argument, for messages.
    values : the array.
    shape : allowed shape.
    kind : type of the numbers; None for any values.
    """
    try:
        array = np.asarray(values, kind)
    except (TypeError, ValueError):
        raise InputError(source, argument, "no numbers", "an array") from None
    fits = array.ndim == len(shape) and all(
        allowed is None or length == allowed
        for length, allowed in zip(array.shape, shape, strict=True)
    )
    if not fits:
        lengths = ", ".join("N" if length is None else str(length) for length in shape)
        finding = f"an array of shape {array.shape}"
        raise InputError(source, argument, finding, f"an array of shape ({lengths})")
    return array


def check_instance(
    source: str, argument: str, value: Any, kinds: type | tuple[type, ...], allowed: str
) -> None:
    """Refuse an argument of another class; `allowed` says what to pass instead."""
    if not isinstance(value, kinds):
        raise InputError(source, argument, repr(value), allowed)


def check_count(source: str, argument: str, value: Any, lowest: int) -> None:
    """Refuse an argument that is no integer, or below the lowest one."""
    if not isinstance(value, Integral) or value < lowest:
        raise InputError(source, argument, repr(value), f"an integer, {lowest} or more")


def check_size(source: str, argument: str, value: Any) -> None:
    """Refuse an argument that is no finite number, or negative."""
    if not isinstance(value, Real) or not math.isfinite(value) or value < 0:
        raise InputError(source, argument, repr(value), "a finite number, 0 or more")
