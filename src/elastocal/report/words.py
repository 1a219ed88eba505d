"""Write effects, locations, hypotheses, numbers and units as a robot engineer does:
gravity sag of joint 2, 117.6 ± 3.6 µrad.

The names of effects come from the catalogue. The functions of this module are filters of
the templates that have the sentences.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from elastocal import counting
from elastocal.counting import pluralize
from elastocal.diagnosis.hypotheses import OTHER, RELATED
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import effect_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from elastocal.verdict import JointRange, MechanismSet

MICRO = 1e6
MILLI = 1e3
NOTHING = "nothing is missing"
UNKNOWN = "something that the catalogue does not have"
# A blank without a line break.
_TIED = "\u00a0"
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_KEY = r"(?P<effect>{names})(?:@(?P<joints>\d+(?:\+\d+)*))?(?:\[(?P<detail>[^\]]*)\])?"
_ANY_KEY = re.compile(_KEY.format(names=r"[^@\[]+") + "$")
_LOCATION = re.compile(
    r"^(?:(?P<kind>joint|link)s? (?P<joints>\d+(?: and \d+)*))? ?(?P<detail>.*)$"
)
# Patterns in the names of parameters, and their words.
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
# Patterns in the names of data sets, and their words.
_DATA_SET_WORDS = (
    (r"^(fanuc|ur5|ur10|wam|kuka|fr3)\b", lambda robot: robot[0].upper()),
    (r"^(motoman|panda)\b", lambda robot: robot[0].capitalize()),
    (r"\bjoint\b", "both sessions"),
    (r"\bcpa\b", "one-joint poses"),
    (r"\bstatic\b", "static poses"),
    (r"\b(grid|random)\b", r"\1 poses"),
)
# Common kind of the mechanisms of a family.
_IN_COMMON = {
    "elastic": "yielding",
    "geometry": "an error of geometry",
    "gravity": "weight",
    "transmission": "an error of a gear",
    "gearbox": "an error of a gear",
    "load": "an error of the load",
    "drift": "drift of the set-up or by warmth",
}
# Parts of a robot that a location may name instead of a joint.
_PARTS = ("column", "base")
# From here on a length, rounded to three digits in µm, is a millimetre.
_ROUNDS_TO_MM = 0.9995e-3
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
    (text,) = _list_locations(effect, [_LOCATION.match(location)])
    return text.removeprefix("of ") or "the whole robot"


def format_places(keys: Sequence[str]) -> str:
    """Return the locations of candidates of one effect without its name: joints 2 and 3;
    empty if they have none."""
    locations = _list_locations(effect_of(keys[0]), map(_ANY_KEY.match, keys))
    return join_items(location.removeprefix("of ") for location in locations)


def format_joints(effect: str, joints: Collection[int]) -> str:
    """Return the joints or links of an effect, " of joint 3"; empty without joints."""
    if not joints:
        return ""
    noun = getattr(list_effects().get(effect), "part", "joint")
    return f" of {pluralize(noun, len(joints))} {join_items(map(str, joints))}"


def _format_locations(effect: str, matches: Iterable[re.Match[str] | None]) -> str:
    """Return joints or links with their details: " of joint 4 (orders 1-2)". Arguments as
    in `_list_locations`."""
    locations = _list_locations(effect, matches)
    return f" {join_items(locations)}" if any(locations) else ""


def _list_locations(effect: str, matches: Iterable[re.Match[str] | None]) -> list[str]:
    """Return each location with its details, "of joint 4 (orders 1-2)", or all joints in
    one text if they have no details. The whole robot is an empty text.

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
        listed_joints = sorted(joints[0] for joints in details_by_joints)
        return [format_joints(effect, listed_joints).strip()]
    in_list = len(details_by_joints) > 1
    return [
        _format_single_location(effect, joints, ", ".join(details), in_list=in_list)
        for joints, details in details_by_joints.items()
    ]


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

    A hypothesis that contains all mechanisms of the first one is described by its
    additional mechanisms. `OTHER` alone is something that the catalogue does not have;
    together with a mechanism it means that a related mechanism may act.
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
            addition = format_mechanisms(sorted(added), hypothesis.locations)
            hypotheses.append(f"the same with {addition}")
    return hypotheses


def format_mechanisms(
    names: Collection[str], locations: Mapping[str, Iterable[str]] = {}
) -> str:
    """Return a set of mechanisms in words.

    Parameters
    ----------
    names : collection of str
        Effects of the catalogue, and `OTHER`.
    locations : mapping of iterables of str
        Locations of some of the effects.
    """
    effects = [
        format_located_effect(name, locations.get(name, ()))
        for name in names
        if name != OTHER
    ]
    if not effects:
        return UNKNOWN
    text = " with ".join(effects)
    return f"{text} or {RELATED}" if OTHER in names else text


def format_alternative(name: str) -> str:
    """Return the words for an alternative: another mechanism, or a related one."""
    return RELATED if name == OTHER else name_effect(name)


def find_common_kind(effect: str, alternatives: Iterable[str]) -> str:
    """Return the common kind of an effect and its alternatives, such as "yielding".

    The result is empty if they are of several kinds, or if one of them is not in the
    catalogue, because it may be of any kind.
    """
    kinds = set()
    for name in (effect, *alternatives):
        family = getattr(list_effects().get(name), "family", "")
        kinds.add(_IN_COMMON.get(family, ""))
    return kinds.pop() if len(kinds) == 1 else ""


def spell_out_names(text: str) -> str:
    """Return a text with names of the catalogue, keys of candidates and the parameters
    stated after them in words."""
    names = "|".join(sorted(list_effects(), key=len, reverse=True))

    def spell_out(match: re.Match[str]) -> str:
        # Names that are common words, such as payload, are meant only as keys or if the
        # text states something about them.
        is_key = match["joints"] or match["detail"]
        is_common_word = "_" not in match["effect"] and not is_key
        if is_common_word and not text[match.end("key") :].startswith(":"):
            return match.group()
        candidate = format_candidate(match["key"])
        if not match["parameter"]:
            return candidate
        return f"{candidate}: {name_parameter(match['effect'], match['parameter'])} is "

    key = r"(?<![\w@])(?P<key>" + _KEY.format(names=names) + r")(?!\w)"
    return re.sub(key + r"(?:: (?P<parameter>\w+) is )?", spell_out, text)


def split_underscores(name: str) -> str:
    """Return a name of the catalogue or of a parameter as words."""
    return name.replace("_", " ")


def name_data_set(name: str) -> str:
    """Return the file name of a campaign as people write it: UR10 A, judged on B."""
    words = name.replace("_on_", ", judged on ").replace("_", " ")
    words = re.sub(r"\b[ab]\b", lambda series: series[0].upper(), words)
    for pattern, replacement in _DATA_SET_WORDS:
        words = re.sub(pattern, replacement, words)
    return words


def join_items(
    items: Iterable[str], limit: int | None = None, last: str = "and"
) -> str:
    """Join items for a sentence: "a, b and c".

    Parameters
    ----------
    items : iterable of str
        The items.
    limit : int, optional
        Upper bound on the items that are named; the others are counted.
    last : str
        Word before the last item.
    """
    shown = list(items)
    if limit is not None and len(shown) > limit:
        shown = [*shown[:limit], f"{len(shown) - limit} more"]
    if not shown:
        return "none"
    if len(shown) == 1:
        return shown[0]
    return f"{', '.join(shown[:-1])} {last} {shown[-1]}"


def capitalize_first(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def format_sentence(text: str) -> str:
    """Return a text with a capital first letter and a full stop."""
    sentence = capitalize_first(text.strip())
    return sentence if sentence.endswith(".") else f"{sentence}."


def set_minus(text: str) -> str:
    """Return a number with a typographic minus sign for its hyphen."""
    return text.replace("-", "−")


def set_minus_in_sentence(text: str) -> str:
    """Return a sentence with typographic minus signs in its numbers."""
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
    """Return how many units a metre has, and the unit: µm below one millimetre, else
    mm."""
    return (MICRO, "µm") if abs(metres) < _ROUNDS_TO_MM else (MILLI, "mm")


def format_length(metres: float | None, digits: int = 3) -> str:
    """Return a length with its unit; "unknown" for None."""
    if metres is None:
        return "unknown"
    factor, unit = choose_length_unit(metres)
    return f"{format_number(factor * metres, digits)}{_TIED}{unit}"


def format_millimetres(metres: float) -> str:
    """Return a length in mm without its unit, with three digits but none below a
    micrometre."""
    millimetres = MILLI * metres
    if abs(metres) < _ROUNDS_TO_MM:
        return f"{millimetres:.3f}"
    return format_number(millimetres)


def format_microradians(radians: float) -> str:
    """Return an angle in µrad with its unit."""
    return f"{format_number(MICRO * radians)} µrad"


def format_estimate(value: float, error: float) -> str:
    """Return a number ± its standard error, of which two digits are given."""
    decimals = max(0, 1 - int(np.floor(np.log10(error))))
    # Adding zero removes the sign of a value that is rounded to zero.
    rounded = round(value, decimals) + 0.0
    return set_minus(f"{rounded:.{decimals}f} ± {error:.{decimals}f}")


def format_number(value: float, digits: int = 3) -> str:
    """Return a number with a number of significant digits and without an exponent."""
    if value == 0:
        return "0"
    # Round first: a value that rounds up to the next power of ten has one decimal less.
    power = int(f"{value:.{digits - 1}e}".split("e")[1])
    return f"{value:.{max(0, digits - 1 - power)}f}"


def format_percent(share: float) -> str:
    """Return a share in percent."""
    return f"{100 * share:.0f}{_TIED}%"


def format_probability(probability: float) -> str:
    """Return a probability in whole percent; none is given as 0 or 100 %."""
    if probability < 0.005:
        return f"<{_TIED}1{_TIED}%"
    if probability >= 0.995:
        return f">{_TIED}99{_TIED}%"
    return format_percent(probability)


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
