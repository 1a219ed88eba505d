"""Effects that a campaign was found to have, and faults of its data, as its report presents them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from elastocal.counting import counted, grouped, plural
from elastocal.data_checks.protocol import OF_DATA
from elastocal.diagnosis.words import alternative_words, listed, parameter_words, physical_name
from elastocal.effects.catalogue import effects
from elastocal.effects.protocol import effect_of
from elastocal.report.first_page import LEAST_SHOWN, MOST_NAMES, cost_words, location_words
from elastocal.report.loop_parameters import MOSTLY_PRIOR
from elastocal.report.wording import as_sentence, capital, length, members_words, probability_words, scaled, words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

NONE_FOUND = {
    "adequate": "No mechanism of the catalogue is needed to explain these measurements.",
    "unexplained": "No mechanism of the catalogue explains these measurements.",
    "not_testable": "No mechanism of the catalogue could be tested.",
}
# More than these would fill pages that nobody reads; the tables have them all.
_MOST_PARAMETERS, _SHOWN_PARAMETERS = 16, 10


def effect_facts(effect: Mapping[str, Any], heldout: Mapping[str, Any]) -> dict[str, Any]:
    """Facts of one effect or fault of the data.

    `heldout`: of verdict.json.
    """
    known = [entry for entry in effect["parameters"] if not entry.get("held") or entry.get("shape")]
    rest = ""
    shown = known
    if len(known) > _MOST_PARAMETERS:
        shown = sorted(known, key=_distance_from_zero, reverse=True)[:_SHOWN_PARAMETERS]
        rest = (
            f"The {len(shown)} of {grouped(len(known))} parameters that lie farthest from zero, in standard errors; "
            "steps.parquet has them all."
        )
    members = effect["members"]
    rows = [_parameter_row(entry, members) for entry in shown]
    if any("q)" in row[0] for row in rows):
        rest = f"{rest} In these, q is the angle of the joint.".strip()
    held = len(effect["parameters"]) - len(known)
    gain, of_data = effect["heldout_gain"], effect["family"] == OF_DATA
    locations = effect["locations"]
    return {
        "name": capital(words(effect["name"]) if of_data else physical_name(effect["name"])) + _of_data_joints(effect),
        "catalogue": "" if of_data else effect["name"],
        "family": effect["family"],
        "description": as_sentence(effect.get("detail") or description(effect["name"])),
        "members": members_words(members),
        "locations": [
            [location_words(effect["name"], entry["location"]), probability_words(entry["probability"])]
            for entry in locations
            if entry["probability"] >= LEAST_SHOWN
        ]
        if len(locations) > 1
        else [],
        "parameters": rows,
        "with_prior": any(entry.get("prior_std") for entry in shown),
        "rest": rest,
        "held": f"{counted(held, 'of its parameters', 'of its parameters')} cannot be identified from these measurements."
        if held
        else "",
        "probability": "" if effect["probability"] is None else probability_words(effect["probability"]),
        "cost": "" if of_data or not effect["adopted"] else cost_words(effect, heldout),
        "gain": "" if gain is None else _gain(gain),
        "adopted": effect["adopted"],
        "alternatives": listed(
            effect["alternatives"] if of_data else map(alternative_words, effect["alternatives"]), MOST_NAMES
        )
        if effect["alternatives"]
        else "",
        "evidence": _evidence(effect.get("evidence")),
    }


def description(effect: str) -> str:
    """What an effect of the catalogue is, in the first line of its docstring, without the formula."""
    known = effects().get(effect)
    summary = known.doc.split("\n")[0] if known and known.doc else words(effect)
    return re.sub(r", \w+\([^,]*=.*$", "", summary.split(":")[0]).rstrip(".")


def _evidence(evidence: Sequence[float | None] | None) -> str:
    """RMS distance between measured and predicted positions as written and with the fault corrected."""
    if not evidence or None in evidence or len(evidence) < 2:
        return ""
    before, after = evidence[:2]
    return f"As written the data lie {length(before)} RMS from the nominal robot, corrected {length(after)}."


def _of_data_joints(effect: Mapping[str, Any]) -> str:
    joints = effect["joints"] if effect["family"] == OF_DATA else ()
    return f" of {plural('joint', len(joints))} {listed(map(str, joints))}" if joints else ""


def _gain(gain: float) -> str:
    return f"{'lowers' if gain >= 0 else 'raises'} the RMS error of the validation poses by {100 * abs(gain):.0f} %"


def _parameter_row(entry: Mapping[str, Any], members: Sequence[str]) -> list[str]:
    # The longest, since keys may have blanks and one may begin another.
    member = max((key for key in members if entry["name"].startswith(f"{key} ")), key=len, default=None)
    # What belongs to an effect as a whole, such as its largest sag, is no member's; faults of the data have none.
    owner = member or (effect_of(members[0]) if members else "")
    name = parameter_words(effect_of(owner), entry["name"].removeprefix(f"{owner} ")) if owner else words(entry["name"])
    where = f"{members_words([member])}: " if member and len(members) > 1 else ""
    row = [where + name, *scaled(entry["value"], entry["std_error"], entry["unit"])]
    if entry["unit"] == "–" and float(entry["value"]).is_integer():
        row[1] = grouped(int(entry["value"]))
    prior = entry.get("prior_std")
    if prior and entry["std_error"] > MOSTLY_PRIOR * prior:
        return [*row, "mostly the prior"]
    searched = "the best of those tried" if entry.get("shape") else ""
    return [*row, "measurements" if entry["std_error"] else searched]


def _distance_from_zero(entry: Mapping[str, Any]) -> float:
    return abs(entry["value"]) / entry["std_error"] if entry["std_error"] else 0.0
