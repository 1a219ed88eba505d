"""Counts with their nouns, as messages and reports write them."""

from __future__ import annotations


def counted(number: int, one: str, many: str | None = None) -> str:
    """A number with its noun, with thin spaces in large numbers: 1 row, 2 rows."""
    return f"{grouped(number)} {plural(one, number, many)}"


def spell_count(number: int, one: str) -> str:
    """A number with its noun, up to three as words: one row, three rows, 4 rows."""
    words = {1: "one", 2: "two", 3: "three"}
    return f"{words.get(number, number)} {plural(one, number)}"


def plural(one: str, number: int, many: str | None = None) -> str:
    """A noun in the form of its number: row, rows."""
    return one if number == 1 else many or one + "s"


def grouped(number: int) -> str:
    """A whole number with a thin space between thousands."""
    return f"{number:,}".replace(",", "\u2009")
