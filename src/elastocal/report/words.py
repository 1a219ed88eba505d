"""Effects, locations, hypotheses, numbers and units as a robot engineer writes them:
gravity sag of joint 2, 117.6 ± 3.6 µrad.

Each effect of the catalogue brings its own words; nothing here knows one by name.
Sentences stand in templates, which have the functions of this module as filters.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from elastocal import counting
from elastocal.counting import pluralize
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import effect_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from elastocal.verdict import JointRange, MechanismSet

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
# Parts of a robot that stand in a location in the place of a joint.
_PARTS = ("column", "base")
# Upper bound on the locations that are listed with details, such as bands of orders; of
# more locations only the joints are listed.
_MAX_DETAILED = 2


def name_effect(effect: str) -> str:
    """Return the physical name of an effect; an effect that the catalogue does not have
    is called by its own name."""
    return getattr(list_effects().get(effect), "words", split_underscores(effect))


def name_parameter(effect: str, name: str) -> str:
    """Return a parameter as an engineer would call it: shift along x for dx, cos(2q) for
    cos_2q.

    Parameters
    ----------
    effect : str
        Name in the catalogue. An owner that is not there, such as a frame, has no words
        of its own.
    name : str
        Name of the parameter.
    """
    own_words = getattr(list_effects().get(effect), "parameter_words", {})
    text = own_words.get(name, split_underscores(name))
    for pattern, replacement in _PARAMETER_WORDS:
        text = re.sub(pattern, replacement, text)
    return text


def format_located_effect(effect: str, locations: Iterable[str] = ()) -> str:
    """Return an effect with its locations as verdict.json has them: gravity sag of
    joints 2 and 3."""
    return name_effect(effect) + _format_locations(
        effect, map(_LOCATION.match, locations)
    )


def format_found_effect(effect: str, keys: Iterable[str]) -> str:
    """Return an effect with the locations of its candidates, which keys give."""
    return name_effect(effect) + _format_locations(effect, map(_ANY_KEY.match, keys))


def format_candidate(key: str) -> str:
    """Return the key of a candidate in words: zero offset of joint 3, gear transmission
    error of joint 1 (orders 1-2)."""
    match = _ANY_KEY.match(key)
    return (
        format_found_effect(match["effect"], [key]) if match else split_underscores(key)
    )


def format_location(effect: str, location: str) -> str:
    """Return a location without its effect: links 1, 2 and 3 (one section)."""
    text = _format_locations(effect, [_LOCATION.match(location)])
    return text.removeprefix(" of ").strip() or "the whole robot"


def format_places(keys: Sequence[str]) -> str:
    """Return the locations of candidates of one effect without its name: joints 2 and 3;
    empty if they have none."""
    text = _format_locations(effect_of(keys[0]), map(_ANY_KEY.match, keys))
    return text.removeprefix(" of ").strip()


def format_joints(effect: str, joints: Collection[int]) -> str:
    """Return the joints or links of an effect, " of joint 3"; empty without joints."""
    if not joints:
        return ""
    noun = getattr(list_effects().get(effect), "part", "joint")
    return f" of {pluralize(noun, len(joints))} {join_items(map(str, joints))}"


def _format_locations(effect: str, matches: Iterable[re.Match[str] | None]) -> str:
    """Return joints or links with their details: " of joint 4 (orders 1-2)".

    Parameters
    ----------
    effect : str
        Name in the catalogue.
    matches : iterable of re.Match
        Locations or keys, as `_LOCATION` and `_ANY_KEY` match them.
    """
    details_by_joints: dict[tuple[int, ...], list[str]] = {}
    for match in matches:
        assert match is not None
        joints = tuple(map(int, re.findall(r"\d+", match["joints"] or "")))
        details = details_by_joints.setdefault(joints, [])
        if match["detail"]:
            details.append(match["detail"])
    if _can_list_joints_alone(details_by_joints):
        return format_joints(effect, sorted(joints[0] for joints in details_by_joints))
    in_list = len(details_by_joints) > 1
    locations = [
        _format_single_location(effect, joints, ", ".join(details), in_list=in_list)
        for joints, details in details_by_joints.items()
    ]
    return f" {join_items(locations)}" if any(locations) else ""


def _can_list_joints_alone(
    details_by_joints: Mapping[tuple[int, ...], Sequence[str]],
) -> bool:
    """Whether several single joints are listed without details: they have none, or too
    many to read."""
    count = len(details_by_joints)
    if count < 2 or any(len(joints) != 1 for joints in details_by_joints):
        return False
    return count > _MAX_DETAILED or not any(details_by_joints.values())


def _format_single_location(
    effect: str, joints: tuple[int, ...], detail: str, *, in_list: bool
) -> str:
    """Return one location with its detail: of joint 4 (orders 1-2)."""
    detail = getattr(list_effects().get(effect), "detail_words", {}).get(detail, detail)
    if not joints and detail in _PARTS:
        return f"of the {detail}"
    location = format_joints(effect, joints)
    # A location without joints needs words only in a list with other locations.
    if not joints and in_list:
        location = " of the whole arm"
    if detail:
        location += f" ({detail})"
    return location.strip()


def format_hypotheses(sets: Sequence[MechanismSet]) -> list[str]:
    """Return hypotheses in words, the most probable one first.

    A hypothesis that contains all mechanisms of the first one is described by what it
    adds. `OTHER` alone is something that the catalogue does not have; together with a
    mechanism it means that a related mechanism may act.
    """
    first = set(sets[0].mechanisms) if sets else set()
    hypotheses = []
    for hypothesis in sets:
        names = set(hypothesis.mechanisms)
        added = names - first
        if not names:
            hypotheses.append(NOTHING)
        elif not first or not first < names:
            hypotheses.append(
                format_mechanisms(hypothesis.mechanisms, hypothesis.locations)
            )
        elif added == {OTHER}:
            hypotheses.append(f"the same or {RELATED}")
        else:
            words = format_mechanisms(sorted(added), hypothesis.locations)
            hypotheses.append(f"the same with {words}")
    return hypotheses


def format_mechanisms(
    names: Collection[str], locations: Mapping[str, Iterable[str]] = {}
) -> str:
    """A set of mechanisms with their locations, where these are stated."""
    named = [
        format_located_effect(name, locations.get(name, ()))
        for name in names
        if name != OTHER
    ]
    return " with ".join(named) + (
        f" or {RELATED}" if named and OTHER in names else "" if named else UNKNOWN
    )


def format_alternative(name: str) -> str:
    """What may be meant instead of a mechanism: another, or a related one."""
    return RELATED if name == OTHER else name_effect(name)


def find_common_kind(effect: str, alternatives: Iterable[str]) -> str:
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


def spell_out_names(text: str) -> str:
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
            f": {name_parameter(found['effect'], found['parameter'])} is "
            if found["parameter"]
            else ""
        )
        return format_candidate(found["key"]) + stated

    key = r"(?<![\w@])(?P<key>" + _KEY.format(names=names) + r")(?!\w)"
    return re.sub(key + r"(?:: (?P<parameter>\w+) is )?", worded, text)


def split_underscores(name: str) -> str:
    """A name of the catalogue or of a parameter as words."""
    return name.replace("_", " ")


def join_items(items: Iterable[str], most: int | None = None, last: str = "and") -> str:
    """Return items as they stand in a sentence.

    Parameters
    ----------
    items : iterable of str
        The items.
    most : int, optional
        Upper bound on their number; the others are counted.
    last : str
        Word before the last item.
    """
    shown = list(items)
    if most is not None and len(shown) > most:
        shown = [*shown[:most], f"{len(shown) - most} more"]
    if not shown:
        return "none"
    if len(shown) == 1:
        return shown[0]
    return f"{', '.join(shown[:-1])} {last} {shown[-1]}"


def capitalize_first(text: str) -> str:
    """A text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def format_sentence(text: str) -> str:
    """A text with a capital and a full stop."""
    text = text.strip()
    return capitalize_first(text) + ("" if text.endswith(".") else ".")


def set_minus(text: str) -> str:
    """A number with a true minus sign."""
    return text.replace("-", "−")


def set_minus_in_sentence(text: str) -> str:
    """A sentence whose numbers have a true minus sign."""
    return re.sub(r"(?<= )-(?=\d)", "−", text)


def format_joint_ranges(joint_ranges: Sequence[JointRange]) -> str:
    """Return the range of each joint in words."""
    ranges = []
    for joint, ends in enumerate(joint_ranges, 1):
        if ends.unit == "deg":
            text = f"joint {joint} {ends.low:.0f} to {ends.high:.0f}°"
        else:
            text = f"joint {joint} {ends.low:.2f} to {ends.high:.2f} m"
        ranges.append(set_minus(text))
    return ", ".join(ranges)


def choose_length_unit(metres: float) -> tuple[float, str]:
    """Unit in which a length is shown, with how many of them a metre has: µm below one
    millimetre."""
    return (MICRO, "µm") if abs(metres) < 0.9995e-3 else (MILLI, "mm")


def format_length(metres: float | None, digits: int = 3) -> str:
    """A length with its unit, µm below one millimetre; "unknown" where there is
    none."""
    if metres is None:
        return "unknown"
    factor, unit = choose_length_unit(metres)
    return f"{format_number(factor * metres, digits)}{_TIED}{unit}"


def format_millimetres(metres: float) -> str:
    """A length without its unit in mm: three digits, and none finer than a
    micrometre."""
    return (
        format_number(MILLI * metres)
        if abs(metres) >= 0.9995e-3
        else f"{MILLI * metres:.3f}"
    )


def format_microradians(radians: float) -> str:
    """An angle in µrad, with its unit."""
    return f"{format_number(MICRO * radians)} µrad"


def format_estimate(value: float, error: float) -> str:
    """A number ± its standard error, of which two digits are given."""
    decimals = max(0, 1 - int(np.floor(np.log10(error))))
    # What is rounded to zero has no sign.
    return set_minus(
        f"{round(value, decimals) + 0.0:.{decimals}f} ± {error:.{decimals}f}"
    )


def format_number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits and without an exponent."""
    if value == 0:
        return "0"
    # Rounded first: what rounds up to the next power of ten has one decimal less.
    power = int(f"{value:.{digits - 1}e}".split("e")[1])
    return f"{value:.{max(0, digits - 1 - power)}f}"


def format_percent(share: float) -> str:
    """A share in percent."""
    return f"{100 * share:.0f}{_TIED}%"


def format_probability(probability: float) -> str:
    """A probability in whole percent; none is given as 0 or 100 %."""
    if probability < 0.005:
        return f"<{_TIED}1{_TIED}%"
    return (
        f">{_TIED}99{_TIED}%" if probability >= 0.995 else format_percent(probability)
    )


def format_with_unit(value: float, error: float | None, unit: str) -> tuple[str, str]:
    """Return a value with its standard error, and the unit that suits it.

    Parameters
    ----------
    value : float
        The value.
    error : float or None
        Its standard error, of which two digits are given; none if it is unknown or zero.
    unit : str
        As in the tables: rad/(N m); 1 for none.
    """
    factor, shown_unit = _choose_unit(value, unit)
    number = factor * value
    std_error = factor * error if error else 0.0
    if not np.isfinite(std_error) or std_error <= 0:
        std_error = 0.0
    size = max(abs(number), std_error)
    # A number that no prefix makes handy gets a power of ten.
    power = 0
    if size and not 1e-3 <= size < 1e5:
        power = int(np.floor(np.log10(size)))
    number = number / 10.0**power
    std_error = std_error / 10.0**power
    text = (
        format_estimate(number, std_error)
        if std_error
        else set_minus(format_number(number, 4))
    )
    if power:
        mantissa = f"({text})" if std_error else text
        text = f"{mantissa} · 10{str(power).translate(_SUPERSCRIPTS)}"
    return text, shown_unit


def _choose_unit(value: float, unit: str) -> tuple[float, str]:
    """Return the factor of a prefix that suits a value, and the unit with it."""
    factor = 1.0
    prefix = ""
    is_angle = bool(re.match(r"rad\b(?!/rad)", unit))
    is_length = bool(re.match(r"m\b(?!/m)", unit))
    if (is_angle and abs(value) < 1e-2) or (is_length and abs(value) < 1e-3):
        factor = MICRO
        prefix = "µ"
    elif is_length and abs(value) < 1:
        factor = MILLI
        prefix = "m"
    shown = prefix + ("" if unit in ("1", "–") else unit)
    shown = shown.replace("^2", "²").replace("^3", "³")
    return factor, re.sub(r"(?<=\w|²|³) (?=\w)", "·", shown)


# Functions that templates may use as filters.
FILTERS = {
    name: function
    for name, function in {**vars(counting), **globals()}.items()
    if callable(function) and name[0] != "_"
}
