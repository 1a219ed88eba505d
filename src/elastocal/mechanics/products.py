"""Products of numbers and arrays, and sums of two, in which a plain 0 or 1 costs nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


def product(a: float | np.ndarray, b: float | np.ndarray) -> float | np.ndarray:
    """a b; by a plain 1 the other factor itself, not a copy.

    `a`, `b` (S,). Returns (S,).
    """
    if type(a) is float:
        if a == 0.0:
            return 0.0
        if a == 1.0:
            return b
    if type(b) is float:
        if b == 0.0:
            return 0.0
        if b == 1.0:
            return a
    return a * b


def product_sum(
    a: float | np.ndarray, b: float | np.ndarray, c: float | np.ndarray, d: float | np.ndarray
) -> float | np.ndarray:
    """a b + c d; the sum reuses the memory of a product that nobody else holds.

    `a`, `b`, `c`, `d` (S,). Returns (S,).
    """
    first, second = product(a, b), product(c, d)
    if type(second) is float and second == 0.0:
        return first
    if type(first) is float:
        return second if first == 0.0 else first + second
    if first is a or first is b:
        return first + second
    first += second
    return first


def product_difference(
    a: float | np.ndarray, b: float | np.ndarray, c: float | np.ndarray, d: float | np.ndarray
) -> float | np.ndarray:
    """a b - c d; the difference reuses the memory of a product that nobody else holds.

    `a`, `b`, `c`, `d` (S,). Returns (S,).
    """
    first, second = product(a, b), product(c, d)
    if type(second) is float and second == 0.0:
        return first
    if type(first) is float:
        return -second if first == 0.0 else first - second
    if first is a or first is b:
        return first - second
    first -= second
    return first
