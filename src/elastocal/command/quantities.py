"""Options that state quantities: lengths and angles with their unit, and lists of numbers."""

import math
import re
from collections.abc import Mapping

from elastocal.errors import InputError

_METRES = {"mm": 1e-3, "um": 1e-6, "µm": 1e-6, "m": 1.0}
_RADIANS = {"deg": math.radians(1.0), "°": math.radians(1.0), "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6}
_QUANTITY = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*([a-zµ°]+)")
# No instrument repeats better than the least (`fitting.noise.FINEST`); no accuracy, noise or tolerance of a robot is larger.
_LEAST_M, _LARGEST_M = 1e-8, 0.1
_LEAST_RAD, _LARGEST_RAD = 1e-8, 0.2
# Of a mass, over the mass, as in a robot file.
LARGEST_RELATIVE_STD = 100.0
# Trackers stand at up to a hundred metres, targets within an arm's reach of where they are fixed, as in a campaign.
_FARTHEST_PLACE_M, FARTHEST_TARGET_M = 1e3, 10.0
# Draws are numbered in 32 bits; more poses, rows, lines or jobs than these are slips of the keyboard.
LARGEST_SEED, MOST_POSES, MOST_ROWS, MOST_JOBS = 2**32 - 1, 10_000, 10_000_000, 10_000


def length_m(option: str, text: str) -> float:
    """A length such as ``0.2mm`` in metres; refused without its unit, or of a size that no instrument or robot has."""
    return _quantity(option, text, _METRES, (_LEAST_M, _LARGEST_M), "a length with its unit such as 0.2mm or 60um")


def angle_rad(option: str, text: str) -> float:
    """An angle such as ``0.01deg`` in rad; refused without its unit, or of a size that no noise has."""
    examples = "an angle with its unit such as 0.01deg, 0.1mrad or 60urad"
    return _quantity(option, text, _RADIANS, (_LEAST_RAD, _LARGEST_RAD), examples)


def _quantity(option: str, text: str, units: Mapping[str, float], bounds: tuple[float, float], examples: str) -> float:
    """A number with one of some units, of which the one of size 1 is SI, between bounds."""
    match = _QUANTITY.fullmatch(text.strip())
    value = float(match[1]) * units.get(match[2], 0.0) if match else 0.0
    least, largest = bounds
    if not least <= value <= largest:
        unit = next(unit for unit, size in units.items() if size == 1.0)
        raise InputError(option, "", repr(text), f"{examples}, {1e6 * least:g} u{unit} to {largest:g} {unit}")
    return value


def numbers(option: str, text: str, count: int, largest: float = _FARTHEST_PLACE_M) -> list[float]:
    """So many numbers separated by commas, metres, each of at most a size; anything else is refused."""
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    # Not a number is no more than anything either.
    if len(found) != count or not all(abs(number) <= largest for number in found):
        raise InputError(option, "", repr(text), f"{count} numbers separated by commas, each up to {largest:g} m")
    return found
