"""Effects, locations, hypotheses, numbers and units as a robot engineer writes them:
gravity sag of joint 2, 117.6 ± 3.6 µrad.

Each effect of the catalogue brings its own words; nothing here knows one by name.
Sentences stand in templates, which have the functions of this module as filters.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal import counting
from elastocal.counting import pluralize
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import effect_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

MICRO = 1e6
MILLI = 1e3
NOTHING = "nothing is missing"
UNKNOWN = "something that the catalogue does not have"
RELATED = "a related mechanism"
# A blank at which no line ends.
_TIED = "\u00a0"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_KEY = r"(?P<effect>{names})(?:@(?P<joints>\d+(?:\+\d+)*))?(?:\[(?P<detail>[^\]]*)\])?"
_ANY_KEY = re.compile(_KEY.format(names=r"[^@\[]+") + "$")
_LOCATION = re.compile(
    r"^(?:(?P<kind>joint|link)s? (?P<joints>\d+(?: and \d+)*))? ?(?P<detail>.*)$"
)
# What names of parameters are short for.
_PARAMETER_WORDS = (
    (r"^d([xyz])$", r"shift along \1"),
    (r"^r([xyz])$", r"rotation about \1"),
    (r"\b(cos|sin) (\d+|k)q\b", r"\1(\2q)"),
    (r"\b(cos|sin) q\b", r"\1(q)"),
    (r"\b(cos|sin) (\d+) motor\b", r"\1(\2 × motor angle)"),
    (r"\(1q\)", "(q)"),
    (r"\(1 × motor angle\)", "(motor angle)"),
    (r"\bper q(\d+)\b", r"per movement of joint \1"),
    (r"\bmoment\b", "first moment"),
    (r"\b1 over ([EG])([IJ])\b", r"1/(\1\2)"),
)
# What the mechanisms of a family have in common.
_IN_COMMON = {
    "elastic": "yielding",
    "geometry": "an error of geometry",
    "gravity": "weight",
    "transmission": "an error of a gear",
    "gearbox": "an error of a gear",
    "load": "an error of the load",
    "drift": "drift of the set-up or by warmth",
}
# Locations that have no joint: what stands there in the place of one.
_PARTS = ("column", "base")
# Bands of orders, variants and the like are given for as many locations; of more only
# their joints.
_MOST_DETAILED = 2


def physical_name(effect: str) -> str:
    """Physical name of an effect; its own name as words where the catalogue does not
    have it."""
    return getattr(list_effects().get(effect), "words", words(effect))


def parameter_words(effect: str, name: str) -> str:
    """A parameter of an effect as an engineer would call it: shift along x for dx,
    cos(2q) for cos_2q.

    `effect`: by its name in the catalogue; what is not there, such as a frame, has no
    words of its own.
    """
    text = getattr(list_effects().get(effect), "parameter_words", {}).get(
        name, words(name)
    )
    for pattern, instead in _PARAMETER_WORDS:
        text = re.sub(pattern, instead, text)
    return text


def effect_words(effect: str, locations: Iterable[str] = ()) -> str:
    """An effect and where it acts, by locations as verdict.json has them: gravity sag
    of joints 2 and 3."""
    return physical_name(effect) + _where(effect, map(_LOCATION.match, locations))


def found_words(effect: str, keys: Iterable[str]) -> str:
    """The same by the keys of its candidates."""
    return physical_name(effect) + _where(effect, map(_ANY_KEY.match, keys))


def candidate_words(key: str) -> str:
    """The key of a candidate in words: zero offset of joint 3, gear transmission error
    of joint 1 (orders 1-2)."""
    found = _ANY_KEY.match(key)
    return found_words(found["effect"], [key]) if found else words(key)


def location_words(effect: str, location: str) -> str:
    """A location without its effect: links 1, 2 and 3 (one section)."""
    return (
        _where(effect, [_LOCATION.match(location)]).strip().removeprefix("of ")
        or "the whole robot"
    )


def place_words(keys: Sequence[str]) -> str:
    """Where candidates of one effect act, without its name: joints 2 and 3, or
    nothing."""
    return (
        _where(effect_of(keys[0]), map(_ANY_KEY.match, keys))
        .strip()
        .removeprefix("of ")
    )


def at_joints(effect: str, joints: Collection[int]) -> str:
    """Where an effect acts: " of joint 3", or nothing where it is no joint's."""
    part = getattr(list_effects().get(effect), "part", "joint")
    return (
        f" of {pluralize(part, len(joints))} {listed(map(str, joints))}"
        if joints
        else ""
    )


def _where(effect: str, found: Iterable[re.Match[str] | None]) -> str:
    """Where an effect acts, by joints or links and details of keys or locations: " of
    joint 4 (orders 1-2)"."""
    details: dict[tuple[int, ...], list[str]] = {}
    for match in found:
        assert match is not None
        details.setdefault(
            tuple(map(int, re.findall(r"\d+", match["joints"] or ""))), []
        ).append(match["detail"] or "")
    singles = len(details) > 1 and all(len(numbers) == 1 for numbers in details)
    if singles and (
        len(details) > _MOST_DETAILED or not any(map(any, details.values()))
    ):
        return at_joints(effect, sorted(numbers[0] for numbers in details))
    parts = []
    for numbers, which in details.items():
        detail = ", ".join(filter(None, which))
        # A variant in words, where it has some.
        detail = getattr(list_effects().get(effect), "detail_words", {}).get(
            detail, detail
        )
        # What is no joint's needs a place of its own only in a list with those that
        # are.
        where = at_joints(effect, numbers) or (
            " of the whole arm" if len(details) > 1 else ""
        )
        in_place = (
            f" of the {detail}"
            if not numbers and detail in _PARTS
            else where + (f" ({detail})" if detail else "")
        )
        parts.append(in_place.strip())
    return f" {listed(parts)}" if any(parts) else ""


def hypotheses_words(sets: Sequence[Mapping[str, Any]]) -> list[str]:
    """Hypotheses, each a set of mechanisms; those that hold all of the first and more
    by what they add to it.

    `sets`: as in verdict.json, the most probable first. `OTHER` alone is something that
    the catalogue does not have; beside a mechanism, that a related one may act.
    """
    first = set(sets[0]["mechanisms"]) if sets else set()
    found = []
    for entry in sets:
        names = set(entry["mechanisms"])
        if not names:
            found.append(NOTHING)
        elif not first or not first < names:
            found.append(mechanisms_words(entry["mechanisms"], entry["locations"]))
        elif names - first == {OTHER}:
            found.append(f"the same or {RELATED}")
        else:
            found.append(
                "the same with "
                + mechanisms_words(sorted(names - first), entry["locations"])
            )
    return found


def mechanisms_words(
    names: Collection[str], locations: Mapping[str, Iterable[str]] = {}
) -> str:
    """A set of mechanisms with their locations, where these are stated."""
    named = [
        effect_words(name, locations.get(name, ())) for name in names if name != OTHER
    ]
    return " with ".join(named) + (
        f" or {RELATED}" if named and OTHER in names else "" if named else UNKNOWN
    )


def alternative_words(name: str) -> str:
    """What may be meant instead of a mechanism: another, or a related one."""
    return RELATED if name == OTHER else physical_name(name)


def in_common(effect: str, alternatives: Iterable[str]) -> str:
    """What an effect and all that may be meant instead have in common, as people call
    it: yielding; empty of no one kind.

    What the catalogue does not have may be of any.
    """
    families = {
        getattr(list_effects().get(name), "family", "")
        for name in (effect, *alternatives)
    }
    kinds = {_IN_COMMON.get(family, "") for family in families}
    return kinds.pop() if len(kinds) == 1 else ""


def in_words(text: str) -> str:
    """A text with every name of the catalogue, every key of a candidate and the
    parameter stated after it in words."""
    names = "|".join(sorted(list_effects(), key=len, reverse=True))

    def worded(found: re.Match[str]) -> str:
        # Names that are common words, such as payload, are meant only as keys or where
        # something is stated of them.
        stands_alone = not (
            found["joints"]
            or found["detail"]
            or text[found.end("key") :].startswith(":")
        )
        if "_" not in found["effect"] and stands_alone:
            return found.group()
        stated = (
            f": {parameter_words(found['effect'], found['parameter'])} is "
            if found["parameter"]
            else ""
        )
        return candidate_words(found["key"]) + stated

    key = r"(?<![\w@])(?P<key>" + _KEY.format(names=names) + r")(?!\w)"
    return re.sub(key + r"(?:: (?P<parameter>\w+) is )?", worded, text)


def words(name: str) -> str:
    """A name of the catalogue or of a parameter as words."""
    return name.replace("_", " ")


def listed(items: Iterable[str], most: int | None = None, last: str = "and") -> str:
    """Items in a sentence, at most so many of them."""
    items = list(items)
    if most is not None and len(items) > most:
        items = [*items[:most], f"{len(items) - most} more"]
    return (
        items[0]
        if len(items) == 1
        else ", ".join(items[:-1]) + f" {last} " + items[-1]
        if items
        else "none"
    )


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


def true_minus(text: str) -> str:
    """A sentence whose numbers have a true minus sign."""
    return re.sub(r"(?<= )-(?=\d)", "−", text)


def span_words(joint_ranges: Sequence[Mapping[str, Any]]) -> str:
    """Where the joints stood, as of `validation.span.joint_ranges`."""
    each = []
    for joint, ends in enumerate(joint_ranges, 1):
        unit, digits = ("°", 0) if ends["unit"] == "deg" else (" m", 2)
        each.append(
            minus(
                f"joint {joint} {ends['low']:.{digits}f} to {ends['high']:.{digits}f}{unit}"
            )
        )
    return ", ".join(each)


def unit_of(metres: float) -> tuple[float, str]:
    """Unit in which a length is shown, with how many of them a metre has: µm below one
    millimetre."""
    return (MICRO, "µm") if abs(metres) < 0.9995e-3 else (MILLI, "mm")


def length(metres: float | None, digits: int = 3) -> str:
    """A length with its unit, µm below one millimetre; "unknown" where there is
    none."""
    if metres is None:
        return "unknown"
    factor, unit = unit_of(metres)
    return f"{plain(factor * metres, digits)}{_TIED}{unit}"


def millimetres(metres: float) -> str:
    """A length without its unit in mm: three digits, and none finer than a
    micrometre."""
    return (
        plain(MILLI * metres) if abs(metres) >= 0.9995e-3 else f"{MILLI * metres:.3f}"
    )


def microradians(radians: float) -> str:
    """An angle in µrad, with its unit."""
    return f"{plain(MICRO * radians)} µrad"


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
    return f">{_TIED}99{_TIED}%" if probability >= 0.995 else percent(probability)


def scaled(value: float, error: float | None, unit: str) -> tuple[str, str]:
    """A value with its standard error in a unit that suits it.

    `error`: two of its digits are given; none where it is not known or zero. `unit`: as
    in the tables: rad/(N m), 1 for none.
    """
    factor, shown = _unit(value, unit)
    number = factor * value
    error = factor * error if error else 0.0
    if not np.isfinite(error) or error <= 0:
        error = 0.0
    size = max(abs(number), error)
    # What no prefix makes handy gets a power of ten.
    power = 0 if size == 0 or 1e-3 <= size < 1e5 else int(np.floor(np.log10(size)))
    number = number / 10.0**power
    error = error / 10.0**power
    text = pm(number, error) if error else minus(plain(number, 4))
    if power:
        text = (
            (f"({text})" if error else text)
            + " · 10"
            + str(power).translate(_SUPERSCRIPTS)
        )
    return text, shown


def _unit(value: float, unit: str) -> tuple[float, str]:
    shown = {"1": "", "–": ""}.get(unit, unit)
    factor = 1.0
    if re.match(r"rad\b(?!/rad)", unit) and abs(value) < 1e-2:
        factor = MICRO
        shown = "µ" + shown
    elif re.match(r"m\b(?!/m)", unit):
        factor, prefix = (
            (MICRO, "µ")
            if abs(value) < 1e-3
            else (MILLI, "m")
            if abs(value) < 1
            else (1.0, "")
        )
        shown = prefix + shown
    for power, sign in (("^2", "²"), ("^3", "³")):
        shown = shown.replace(power, sign)
    return factor, re.sub(r"(?<=\w|²|³) (?=\w)", "·", shown)


# What sentences and pages may apply to what they show.
FILTERS = {
    name: each
    for name, each in {**vars(counting), **globals()}.items()
    if callable(each) and name[0] != "_"
}
