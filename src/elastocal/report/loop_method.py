"""How a campaign was diagnosed: numbers of the method, its settings, and candidates that could not be tested."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from elastocal.counting import counted, grouped
from elastocal.diagnosis.words import listed, physical_name
from elastocal.report.wording import as_sentence, capital, members_words, percent, words

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any


def method(verdict: Mapping[str, Any], descriptions: Mapping[str, Any]) -> dict[str, str | bool]:
    """Numbers and names that the account of the method states.

    `verdict`: contents of verdict.json. `descriptions`: contents of campaign.json.
    """
    other, settings = descriptions["held_out"], verdict["settings"]
    declared = descriptions["campaign"]["declared"]
    return {
        "tested": grouped(verdict["candidates_tested"]),
        "listed": grouped(verdict["candidates_tested"] + len(verdict["untestable"])),
        "draws": grouped(settings["alarm_draws"]["value"]),
        "level": percent(settings["alarm_level"]["value"]),
        "prior": percent(settings["mechanism_probability"]["value"]),
        "named": percent(settings["ambiguity_loss"]["value"]),
        "held_out": counted(verdict["heldout"]["poses"], "pose"),
        "where": f" of another campaign ({other['campaign']['campaign']})" if other else "",
        "declared": listed(map(physical_name, declared)) if declared else "",
        "identified": descriptions["campaign"]["compliance"] == "identify",
        "rigid": descriptions["campaign"]["compliance"] == "nominal" and "compliance_urad_per_Nm" not in descriptions["robot"],
    }


def setting_rows(settings: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """Rows of the settings: name, value, reason."""
    rows = []
    for name, entry in settings.items():
        values = entry["value"] if isinstance(entry["value"], (list, tuple)) else [entry["value"]]
        rows.append([words(name), ", ".join(f"{value:g}" for value in values), as_sentence(entry["reason"])])
    return rows


def untestable_rows(untestable: Mapping[str, str]) -> list[list[str]]:
    """Candidates that were not tested, one row for each effect and reason.

    `untestable`: reason by candidate.
    """
    found: dict[tuple[str, str], list[str]] = {}
    for key, reason in untestable.items():
        alike = reason.replace("no approach", "no direction of approach")
        found.setdefault((re.split(r"[@\[]", key)[0], alike), []).append(key)
    rows = [[capital(physical_name(effect)), members_words(keys, 4) or "–", reason] for (effect, reason), keys in found.items()]
    return sorted(rows, key=lambda row: (row[2], row[0]))
