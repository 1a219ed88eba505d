"""Format numbers, and counts with their nouns, for messages and reports."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def format_count(number: int, singular: str, plural: str | None = None) -> str:
    """Return a number with its noun, with thin spaces in large numbers: 1 row, 2 rows."""
    return f"{format_integer(number)} {pluralize(singular, number, plural)}"


def list_first(names: Sequence[str], most: int) -> str:
    """Return the first names, and the number of further ones: a, b and 3 more."""
    listed = ", ".join(names[:most])
    further = len(names) - most
    return f"{listed} and {further} more" if further > 0 else listed


def pluralize(singular: str, number: int, plural: str | None = None) -> str:
    """Return a noun in the form of its number: row, rows."""
    if number == 1:
        return singular
    return plural or f"{singular}s"


def format_digits(value: float, digits: int) -> str:
    """Return a number with so many significant digits; no exponent follows unless the
    number is small: 100, not 1e+02."""
    return f"{float(f'{value:.{digits}g}'):.12g}"


def format_integer(number: int) -> str:
    """Return a whole number with a thin space between thousands."""
    return f"{number:,}".replace(",", "\u2009")
