"""Counts with their nouns, as messages and reports write them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


def format_count(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun, with thin spaces in large numbers: 1 row, 2 rows."""
    return f"{format_integer(number)} {pluralize(one, number, many)}"


def list_first(names: Sequence[str], most: int) -> str:
    """The first of some names, and how many more there are: a, b and 3 more."""
    return ", ".join(names[:most]) + (
        f" and {len(names) - most} more" if len(names) > most else ""
    )


def pluralize(one: str, number: int, many: str | None = None) -> str:
    """A noun in the form of its number: row, rows."""
    return one if number == 1 else many or one + "s"


def format_integer(number: int) -> str:
    """A whole number with a thin space between thousands."""
    return f"{number:,}".replace(",", "\u2009")
