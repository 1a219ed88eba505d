"""Check arrays that a caller passes."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
