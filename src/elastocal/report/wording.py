"""Numbers, units and names of the loop as people write them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.diagnosis.words import at_joints, detail_words

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

MICRO, MILLI = 1e6, 1e3
# A blank at which no line ends.
_TIED = "\u00a0"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_KEY = re.compile(r"^(?P<effect>[^@\[]+)(?:@(?P<joints>[\d+]+))?(?:\[(?P<detail>.*)\])?$")


def words(name: str) -> str:
    """A name of the catalogue or of a parameter as words."""
    return name.replace("_", " ")


def capital(text: str) -> str:
    """A text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def as_sentence(text: str) -> str:
    """A text with a capital and a full stop."""
    text = text.strip()
    return capital(text) + ("" if text.endswith(".") else ".")


def minus(text: str) -> str:
    """A number with a true minus sign."""
    return text.replace("-", "−")


def span_words(joint_ranges: Sequence[Mapping[str, Any]]) -> str:
    """Where the joints stood, as of `validation.span.joint_ranges`."""
    each = []
    for joint, ends in enumerate(joint_ranges, 1):
        unit, digits = ("°", 0) if ends["unit"] == "deg" else (" m", 2)
        each.append(minus(f"joint {joint} {ends['low']:.{digits}f} to {ends['high']:.{digits}f}{unit}"))
    return ", ".join(each)


def members_words(keys: Iterable[str], most: int = 12) -> str:
    """What an effect was found as: its joints or links and variants, those of one joint together.

    `keys`: keys of candidates of one effect.
    """
    details: dict[tuple[str, tuple[int, ...]], list[str]] = {}
    for key in sorted(keys, key=_natural):
        found = _KEY.match(key)
        assert found, key
        joints = tuple(map(int, found["joints"].split("+"))) if found["joints"] else ()
        details.setdefault((found["effect"], joints), []).append(detail_words(found["effect"], found["detail"] or ""))
    # Single joints with the same details stand together.
    alike: dict[tuple[str, tuple[int, ...] | None, str], list[int]] = {}
    for (effect, joints), which in details.items():
        group = (effect, joints if len(joints) != 1 else None, ", ".join(filter(None, which)))
        alike.setdefault(group, []).extend(joints)
    parts = [
        ": ".join(filter(None, (at_joints(effect, joints).removeprefix(" of "), which)))
        for (effect, _, which), joints in alike.items()
    ]
    shown = [part for part in parts if part]
    return "; ".join(shown[:most]) + (f"; {len(shown) - most} more" if len(shown) > most else "")


def _natural(key: str) -> list[int | str]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", key)]


def length(metres: float | None, digits: int = 3) -> str:
    """A length with its unit, µm below one millimetre; "unknown" where there is none."""
    if metres is None:
        return "unknown"
    factor, unit = (MICRO, "µm") if abs(metres) < 0.9995e-3 else (MILLI, "mm")
    return f"{plain(factor * metres, digits)}{_TIED}{unit}"


def millimetres(metres: float) -> str:
    """A length without its unit in mm: three digits, and none finer than a micrometre."""
    return plain(MILLI * metres) if abs(metres) >= 0.9995e-3 else f"{MILLI * metres:.3f}"


def pm(value: float, error: float) -> str:
    """A number ± its standard error, of which two digits are given."""
    decimals = max(0, 1 - int(np.floor(np.log10(error))))
    # What is rounded to zero has no sign.
    return minus(f"{round(value, decimals) + 0.0:.{decimals}f} ± {error:.{decimals}f}")


def plain(value: float, digits: int = 3) -> str:
    """A number with so many significant digits and without an exponent."""
    if value == 0:
        return "0"
    # Rounded first: what rounds up to the next power of ten has one decimal less.
    power = int(f"{value:.{digits - 1}e}".split("e")[1])
    return f"{value:.{max(0, digits - 1 - power)}f}"


def percent(share: float) -> str:
    """A share in percent."""
    return f"{100 * share:.0f}{_TIED}%"


def probability_words(probability: float) -> str:
    """A probability in whole percent; none is given as 0 or 100 %."""
    if probability < 0.005:
        return f"<{_TIED}1{_TIED}%"
    if probability >= 0.995:
        return f">{_TIED}99{_TIED}%"
    return percent(probability)


def scaled(value: float, error: float | None, unit: str) -> tuple[str, str]:
    """A value with its standard error in a unit that suits it.

    `error`: two of its digits are given; none where it is not known or zero. `unit`: as in the tables: rad/(N m), 1 for none.
    """
    factor, shown = _unit(value, unit)
    number, error = factor * value, factor * error if error else 0.0
    if not np.isfinite(error) or error <= 0:
        error = 0.0
    size = max(abs(number), error)
    # What no prefix makes handy gets a power of ten.
    power = 0 if size == 0 or 1e-3 <= size < 1e5 else int(np.floor(np.log10(size)))
    number, error = number / 10.0**power, error / 10.0**power
    text = pm(number, error) if error else minus(plain(number, 4))
    if power:
        text = f"({text})" if error else text
        text += " · 10" + str(power).translate(_SUPERSCRIPTS)
    return text, shown


def _unit(value: float, unit: str) -> tuple[float, str]:
    shown = {"1": "", "–": ""}.get(unit, unit)
    factor = 1.0
    if re.match(r"rad\b(?!/rad)", unit) and abs(value) < 1e-2:
        factor, shown = MICRO, "µ" + shown
    elif re.match(r"m\b(?!/m)", unit):
        factor, prefix = (MICRO, "µ") if abs(value) < 1e-3 else (MILLI, "m") if abs(value) < 1 else (1.0, "")
        shown = prefix + shown
    for power, sign in (("^2", "²"), ("^3", "³")):
        shown = shown.replace(power, sign)
    return factor, re.sub(r"(?<=\w|²|³) (?=\w)", "·", shown)
