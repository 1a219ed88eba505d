"""Mechanisms, locations and hypotheses in the words of a robot engineer: gravity sag of joint 2 or a related mechanism.

Each effect of the catalogue brings its own words; nothing here knows one by name.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from elastocal.counting import plural
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.effects.catalogue import effects

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

NOTHING = "nothing is missing"
UNKNOWN = "something that the catalogue does not have"
RELATED = "a related mechanism"
_KEY = r"(?P<effect>{names})(?:@(?P<joints>\d+(?:\+\d+)*))?(?:\[(?P<detail>[^\]]*)\])?"
_ANY_KEY = _KEY.format(names=r"[^@\[]+") + "$"
_LOCATION = re.compile(r"^(?:(?P<kind>joint|link)s? (?P<numbers>\d+(?: and \d+)*))? ?(?P<detail>.*)$")
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
# Bands of orders, variants and the like are given for as many locations; of more only their joints.
_MOST_DETAILED = 2


def physical_name(effect: str) -> str:
    """Physical name of an effect of the catalogue; its own name as words where that has none."""
    return getattr(effects().get(effect), "words", effect.replace("_", " "))


def detail_words(effect: str, detail: str) -> str:
    """Which variant of an effect, in words where it has some."""
    return getattr(effects().get(effect), "detail_words", {}).get(detail, detail)


def parameter_words(effect: str, name: str) -> str:
    """A parameter of an effect as an engineer would call it: shift along x for dx, cos(2q) for cos_2q.

    `effect`: by its name in the catalogue; what is not there, such as a frame, has no words of its own.
    """
    text = getattr(effects().get(effect), "parameter_words", {}).get(name, name.replace("_", " "))
    for pattern, instead in _PARAMETER_WORDS:
        text = re.sub(pattern, instead, text)
    return text


def part_of(effect: str) -> str:
    """What the numbers of an effect count: joints, or links, which begin at the joint of the same number."""
    return getattr(effects().get(effect), "part", "joint")


def listed(items: Iterable[str], most: int | None = None, last: str = "and") -> str:
    """Items in a sentence, at most so many of them."""
    items = list(items)
    if most is not None and len(items) > most:
        items = [*items[:most], f"{len(items) - most} more"]
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + f" {last} " + items[-1] if items else "none"


def at_joints(effect: str, joints: Collection[int]) -> str:
    """Where an effect acts: " of joint 3", or nothing where it is no joint's."""
    if not joints:
        return ""
    return f" of {plural(part_of(effect), len(joints))} {listed(map(str, joints))}"


def effect_words(effect: str, locations: Iterable[str] = ()) -> str:
    """An effect and where it acts.

    `locations`: as `findings.location_words` writes them: joint 2, links 1 and 2 one section, joint 4 orders 1-2, column.
    Returns such as: gravity sag of joints 2 and 3.
    """
    parsed = []
    for location in locations:
        found = _LOCATION.match(location)
        assert found is not None
        parsed.append((_numbers_in(found["numbers"]), found["detail"]))
    return physical_name(effect) + _where(effect, parsed)


def found_words(effect: str, keys: Iterable[str]) -> str:
    """An effect and where it was found.

    `keys`: of its candidates. Returns as `effect_words`.
    """
    locations = []
    for key in keys:
        found = re.match(_ANY_KEY, key)
        assert found is not None
        locations.append((_numbers_in(found["joints"]), found["detail"] or ""))
    return physical_name(effect) + _where(effect, locations)


def _numbers_in(text: str | None) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", text or "")))


def candidate_words(key: str) -> str:
    """The key of a candidate in words: zero offset of joint 3, gear transmission error of joint 1 (orders 1-2)."""
    found = re.match(_ANY_KEY, key)
    return found_words(found["effect"], [key]) if found else key.replace("_", " ")


def hypothesis_words(mechanisms: Collection[str], locations: Mapping[str, Iterable[str]] | None = None) -> str:
    """A hypothesis, which is a set of mechanisms, in words.

    `mechanisms`: `OTHER` alone is something that the catalogue does not have; beside a mechanism, that a related one may act.
    `locations`: of each mechanism, see `effect_words`.
    """
    named = [effect_words(name, (locations or {}).get(name, ())) for name in mechanisms if name != OTHER]
    if not named:
        return UNKNOWN if OTHER in mechanisms else NOTHING
    return " with ".join(named) + (f" or {RELATED}" if OTHER in mechanisms else "")


def hypotheses_words(sets: Sequence[Mapping[str, Any]]) -> list[str]:
    """Hypotheses in words; those that hold all of the first and more by what they add to it.

    `sets`: as in verdict.json, the most probable first.
    """
    first = set(sets[0]["mechanisms"]) if sets else set()
    found: list[str] = []
    for entry in sets:
        names = set(entry["mechanisms"])
        if not first or not first < names:
            found.append(hypothesis_words(entry["mechanisms"], entry["locations"]))
        elif names - first == {OTHER}:
            found.append(f"the same or {RELATED}")
        else:
            found.append("the same with " + hypothesis_words(sorted(names - first), entry["locations"]))
    return found


def alternative_words(name: str) -> str:
    """What may be meant instead of a mechanism: another, or a related one."""
    return RELATED if name == OTHER else physical_name(name)


def in_common(effect: str, alternatives: Iterable[str]) -> str:
    """What an effect and all that may be meant instead have in common, as people call it: yielding; empty of no one kind.

    What the catalogue does not have may be of any.
    """
    families = {getattr(effects().get(name), "family", "") for name in (effect, *alternatives)}
    kinds = {_IN_COMMON.get(family, "") for family in families}
    return kinds.pop() if len(kinds) == 1 else ""


def in_words(text: str) -> str:
    """A text with every name of the catalogue, every key of a candidate and the parameter stated after it in words."""
    names = "|".join(sorted(effects(), key=len, reverse=True))

    def worded(found: re.Match[str]) -> str:
        # Names that are common words, such as payload, are meant only as keys or where something is stated of them.
        plain = "_" not in found["effect"] and not (
            found["joints"] or found["detail"] or text[found.end("key") :].startswith(":")
        )
        if plain:
            return found.group()
        stated = f": {parameter_words(found['effect'], found['parameter'])} is " if found["parameter"] else ""
        return candidate_words(found["key"]) + stated

    key = r"(?<![\w@])(?P<key>" + _KEY.format(names=names) + r")(?!\w)"
    return re.sub(key + r"(?:: (?P<parameter>\w+) is )?", worded, text)


def _where(effect: str, locations: Iterable[tuple[tuple[int, ...], str]]) -> str:
    """Where an effect acts, by joints or links and details: " of joint 4 (orders 1-2)"."""
    details: dict[tuple[int, ...], list[str]] = {}
    for numbers, detail in locations:
        details.setdefault(numbers, []).append(detail)
    singles = len(details) > 1 and all(len(numbers) == 1 for numbers in details)
    if singles and (len(details) > _MOST_DETAILED or not any(map(any, details.values()))):
        return at_joints(effect, sorted(numbers[0] for numbers in details))
    parts = [_located(effect, numbers, ", ".join(filter(None, which)), len(details) > 1) for numbers, which in details.items()]
    return f" {listed(part.strip() for part in parts)}" if any(parts) else ""


def _located(effect: str, numbers: tuple[int, ...], detail: str, beside_others: bool) -> str:
    detail = detail_words(effect, detail)
    if not numbers and detail in _PARTS:
        return f" of the {detail}"
    # What is no joint's needs a place of its own only in a list with those that are.
    where = at_joints(effect, numbers) or (" of the whole arm" if beside_others else "")
    return where + (f" ({detail})" if detail else "")
