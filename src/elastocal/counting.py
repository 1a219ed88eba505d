"""Counts with their nouns, as messages and reports write them."""

from __future__ import annotations


def counted(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun, with thin spaces in large numbers: 1 row, 2 rows."""
    return f"{grouped(number)} {one if number == 1 else many or one + 's'}"


def grouped(number: int) -> str:
    """A whole number with a thin space between thousands."""
    return f"{number:,}".replace(",", "\u2009")
