"""What the report of a campaign shows, as PDF and as a page: rows of tables, and the
sentences of `campaign.txt`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from elastocal import __version__
from elastocal.application.statements import tabulate_errors
from elastocal.counting import format_count, format_integer, pluralize
from elastocal.data_checks.protocol import OF_DATA, data_at_fault
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import effect_of
from elastocal.report import words as say
from elastocal.report.typesetting import render_sentences

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

TITLES = {
    "adequate": "the declared model is adequate",
    "named": "one mechanism is missing in the declared model",
    "class": "one mechanism is missing in the declared model; which one is ambiguous",
    "several": "several mechanisms are missing in the declared model",
    "unexplained": "something is missing in the declared model that the catalogue does not have",
    "not_testable": "these measurements can test no mechanism",
}
AT_FAULT = "the data are at fault"
# Where what is left is a function of the joints.
AND_MORE = "; more is missing that has no name"
# Sections of the template that are lists; the others are one paragraph.
_LISTS = (
    "sentences",
    "now",
    "warnings",
    "headline",
    "accuracy",
    "noise",
    "settings",
    "method",
)
# Causes and locations below this are not shown; from `_SURE` on a location is stated
# without its alternatives, a cause is real.
_LEAST_SHOWN = 0.01
_SURE = 0.95
# Causes of which page 1 has a bar, if they are not part of the verdict.
_MOST_CAUSES = 6
# A cause is negligible below this share of the corrected robot's error: squares add up,
# so that leaving it uncorrected raises the error by 5 % at most. Ellison, S. L. R. and
# Williams, A. (eds.), EURACHEM/CITAC Guide CG 4, 2012, section 7.2.2: components below
# a third of the largest need no closer look.
NEGLIGIBLE = 1 / 3
# The last digit of a cost.
_FINEST_M = 1e-6
# More than these would fill pages that nobody reads; the tables have them all.
_MOST_NAMES = 8
_MOST_PARAMETERS = 16
_SHOWN_PARAMETERS = 10
METRICS = ("mean", "rms", "p95", "max")
# Where a standard error is above this share of the prior's, the measurements say hardly
# more than the prior.
MOSTLY_PRIOR = 0.7
# Letters of a list of places beyond which only the first few are shown.
_LONGEST = 100
_SHOWN = 4


def title_of(verdict: Mapping[str, Any]) -> str:
    """Verdict in one line, with what remains without a name."""
    remains = verdict["effects"] and (verdict.get("repeatable") or {}).get("remains")
    return TITLES[verdict["verdict"]] + AND_MORE * bool(remains)


def campaign_sentences(
    verdict: Mapping[str, Any],
    steps: Sequence[Mapping[str, Any]] = (),
    experiment: Sequence[Mapping[str, Any]] = (),
    descriptions: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """What `campaign.txt` says of a campaign, by headings.

    `verdict`: contents of verdict.json. `steps`, `experiment`: rows of before_after.csv
    and next_experiment.csv. `descriptions`: contents of campaign.json; without them
    nothing is stated of the method.
    """
    faulty = data_at_fault(verdict)
    facts = {
        "effects": []
        if faulty
        else [
            effect_facts(effect, verdict["heldout"]) for effect in verdict["effects"]
        ],
        "faulty": faulty,
        "accuracy": verdict.get("accuracy"),
        "ends": [_with_interval(step) for step in steps if step["kind"] != "frames"],
        "new_poses": len({(row["effect"], row["pose"]) for row in experiment}),
        "version": __version__,
    }
    return render_sentences(
        "campaign.txt",
        say.FILTERS,
        verdict={"next_experiment": None, "repeatable": None, **verdict},
        descriptions=descriptions,
        **facts,
    )


def loop_facts(
    verdict: Mapping[str, Any],
    steps: Sequence[Mapping[str, Any]],
    experiment: Sequence[Mapping[str, Any]],
    table: Mapping[str, np.ndarray],
    descriptions: Mapping[str, Any],
    parameters: Mapping[str, np.ndarray],
) -> dict[str, Any]:
    """Facts for the report of a campaign.

    `verdict`: contents of verdict.json. `steps`, `experiment`: rows of before_after.csv
    and next_experiment.csv. `table`, `parameters` (N,): columns of the residuals and of
    the parameters of the final model. `descriptions`: contents of campaign.json.
    Returns JSON-serialisable; strings ready to print, lists for tables.
    """
    faulty = data_at_fault(verdict)
    heldout = verdict["heldout"]
    stated = campaign_sentences(verdict, steps, experiment, descriptions)
    # Probabilities are then those from before the measurements.
    searched = {
        entry["name"]
        for effect in verdict["effects"]
        for entry in effect["parameters"]
        if entry.get("shape")
    }
    held = [
        *(name for name in verdict["held"] if name not in searched),
        *left_to_priors(parameters),
    ]
    return {
        **{
            name: lines if name in _LISTS else " ".join(lines)
            for name, lines in stated.items()
        },
        "method": dict(stated["method"]),
        "campaign": verdict["campaign"],
        "robot": descriptions["robot"]["name"],
        "verdict": AT_FAULT if faulty else title_of(verdict),
        "faulty": faulty,
        "headline": dict(stated["headline"]) or None,
        "causes": [] if verdict["verdict"] == "not_testable" else cause_rows(verdict),
        "errors": tabulate_errors(verdict),
        "measured": measured_rows(table, descriptions),
        "floor": say.length(heldout["noise_floor_rms_m"]),
        "steps": step_rows(steps, heldout["noise_floor_rms_m"]),
        "effects": [effect_facts(effect, heldout) for effect in verdict["effects"]],
        "experiment": experiment_facts(experiment),
        "compliances": compliance_rows(verdict["compliance_urad_per_Nm"]),
        "compliances_identified": any(verdict["compliance_urad_per_Nm"]["std_error"]),
        "held": held_rows(held),
        "untestable": untestable_rows(verdict["untestable"]),
        "found": [effect["name"] for effect in verdict["effects"]],
    }


def cost_words(effect: Mapping[str, Any], heldout: Mapping[str, Any]) -> str:
    """What an effect costs at the campaign's poses and loads: the RMS error if it alone
    were left out of the correction."""
    cost = effect["cost_m"]
    if cost is None:
        known = list_effects().get(effect["name"])
        moves = known is None or known.moves_robot
        return (
            "in no command"
            if moves
            else "an error of the measurement, not of the robot"
        )
    if cost > NEGLIGIBLE * heldout["after"]["rms_m"]:
        return f"{say.millimetres(cost)} mm"
    # No finer than a micrometre, and what was found is not nothing.
    stated = (
        say.millimetres(cost)
        if cost >= _FINEST_M / 2
        else f"below {say.millimetres(_FINEST_M)}"
    )
    return (
        f"{stated} mm: {'real, ' if effect['probability'] >= _SURE else ''}negligible"
    )


def cause_rows(verdict: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What may be missing, the most probable first: in words, with its probability and,
    of what was found, cost and gain.

    Mechanisms may act together, so that probabilities need not add up to one. The gain
    is that of the validation poses.
    """
    stated = verdict["probabilities"]
    found = {effect["name"]: effect for effect in verdict["effects"]}
    if stated is None:
        return []
    rows: list[tuple[str, float, str, float | None]] = []
    for name, each in found.items():
        cost = cost_words(each, verdict["heldout"])
        rows.append(
            (
                say.found_words(name, each["members"]),
                each["probability"],
                cost,
                each["heldout_gain"],
            )
        )
    # Beside a mechanism that was found, what is unknown is a related one.
    unknown = say.RELATED if found else say.UNKNOWN
    mechanisms = stated["mechanisms"].items()
    others = [
        (unknown if name == OTHER else say.physical_name(name), p)
        for name, p in mechanisms
        if name not in found
    ]
    shown = [
        each
        for each in [*others, (say.NOTHING, stated["nothing"])]
        if each[1] >= _LEAST_SHOWN
    ]
    rows += [
        (*each, "", None)
        for each in sorted(shown, key=lambda each: -each[1])[:_MOST_CAUSES]
    ]
    return [
        {
            "name": say.capital(name),
            "probability": probability,
            "words": say.probability_words(probability),
            "cost": cost,
            "gain": "" if gain is None else say.minus(f"{-100 * gain:+.0f} %"),
        }
        for name, probability, cost, gain in sorted(rows, key=lambda row: -row[1])
    ]


def effect_facts(
    effect: Mapping[str, Any], heldout: Mapping[str, Any]
) -> dict[str, Any]:
    """Facts of one effect or fault of the data; `heldout`: of verdict.json."""
    known = [
        entry
        for entry in effect["parameters"]
        if entry.get("identifiable", not entry.get("held"))
    ]
    ranked = sorted(
        known,
        key=lambda entry: (
            -abs(entry["value"]) / entry["std_error"] if entry["std_error"] else 0.0
        ),
    )
    shown = ranked[:_SHOWN_PARAMETERS] if len(known) > _MOST_PARAMETERS else known
    name = effect["name"]
    members = effect["members"]
    of_data = effect["family"] == OF_DATA
    rows = [_parameter_row(entry, members) for entry in shown]
    joints = effect["joints"] if of_data else ()
    at = [
        entry for entry in effect["locations"] if entry["probability"] >= _LEAST_SHOWN
    ]
    where = [
        [
            say.location_words(name, entry["location"]),
            say.probability_words(entry["probability"]),
        ]
        for entry in at
    ]
    sure = len(members) > 1 or not at or at[0]["probability"] >= _SURE
    others = effect["alternatives"]
    evidence = effect.get("evidence") or ()
    instead = others if of_data else [*map(say.alternative_words, others)]
    return {
        "name": say.capital(say.words(name) if of_data else say.physical_name(name))
        + (
            f" of {pluralize('joint', len(joints))} {say.listed(map(str, joints))}"
            if joints
            else ""
        ),
        "found": say.found_words(name, members),
        "bare": say.physical_name(name),
        "catalogue": "" if of_data else name,
        "family": effect["family"],
        "description": say.as_sentence(effect.get("detail") or description(name)),
        "locations": where if len(effect["locations"]) > 1 else [],
        "unsure": []
        if sure
        else [f"{place} ({probability})" for place, probability in where],
        "parameters": rows,
        "with_prior": any(entry.get("prior_std") for entry in shown),
        "left_out": format_integer(len(known)) if len(known) > len(shown) else "",
        "with_angle": any("q)" in row[0] for row in rows),
        "held": len(effect["parameters"]) - len(known),
        "probability": ""
        if effect["probability"] is None
        else say.probability_words(effect["probability"]),
        "cost": "" if of_data else cost_words(effect, heldout),
        "cost_m": effect.get("cost_m"),
        "gain": effect["heldout_gain"],
        "adopted": effect["adopted"],
        "alternatives": say.listed(instead, _MOST_NAMES) if others else "",
        "instead": say.listed(instead, _MOST_NAMES, last="or") if others else "",
        "common": say.in_common(name, others),
        # RMS distance between measured and predicted positions as written and with the
        # fault corrected.
        "evidence": [say.length(value) for value in evidence[:2]]
        if len(evidence) > 1 and None not in evidence
        else [],
    }


def _with_interval(step: Mapping[str, Any]) -> str:
    """RMS error of a step on validation poses with its 95 % interval, in one unit."""
    factor, unit = say.unit_of(step["heldout_rms_m"])
    value, low, high = (
        factor * step[f"heldout_rms_m{end}"] for end in ("", "_low", "_high")
    )
    interval = (
        f" [{say.plain(low)}, {say.plain(high)}]"
        if np.isfinite([low, high]).all()
        else ""
    )
    return f"{say.plain(value)}{interval}\u00a0{unit}"


def description(effect: str) -> str:
    """What an effect of the catalogue is, in the first line of its docstring, without
    the formula."""
    known = list_effects().get(effect)
    summary = known.doc.split("\n")[0] if known and known.doc else say.words(effect)
    return re.sub(r", \w+\([^,]*=.*$", "", summary.split(":")[0]).rstrip(".")


def _parameter_row(entry: Mapping[str, Any], members: Sequence[str]) -> list[str]:
    # The longest, since keys may have blanks and one may begin another.
    member = max(
        (key for key in members if entry["name"].startswith(f"{key} ")),
        key=len,
        default=None,
    )
    # What belongs to an effect as a whole, such as its largest sag, is no member's;
    # faults of the data have none.
    owner = member or (effect_of(members[0]) if members else "")
    name = (
        say.parameter_words(effect_of(owner), entry["name"].removeprefix(f"{owner} "))
        if owner
        else say.words(entry["name"])
    )
    where = f"{say.place_words([member])}: " if member and len(members) > 1 else ""
    row = [where + name, *say.scaled(entry["value"], entry["std_error"], entry["unit"])]
    if entry["unit"] == "–" and float(entry["value"]).is_integer():
        row[1] = format_integer(int(entry["value"]))
    return [
        *row,
        "measurements"
        if entry["std_error"]
        else "the best of those tried"
        if entry.get("shape")
        else "",
    ]


def _cell(row: Mapping[str, Any], name: str, factor: float, unit: str) -> list[str]:
    """A value and its interval, in lines."""
    value, low, high = (factor * row[name + end] for end in ("", "_low", "_high"))
    number, *ends = (
        f"{each:.3f}"
        if unit == "mm"
        else say.minus(f"{each:.0f}")
        if np.isfinite(each)
        else ""
        for each in (value, low, high)
    )
    if np.isnan(low) or np.isnan(high):
        return [number, "–"]
    return [number, f"[{ends[0]}, {ends[1]}]"]


def step_rows(
    steps: Sequence[Mapping[str, Any]], floor_m: float | None
) -> dict[str, Any]:
    """Rows of the table before and after; each error as a list of lines: value,
    interval, multiple of the noise floor."""
    factor, unit = say.unit_of(max(step["heldout_max_m"] for step in steps))
    rows = []
    for step in steps:
        multiples = {
            name: [f"{step[f'heldout_{name}_over_floor']:.2f} × floor"]
            if floor_m
            else []
            for name in METRICS
        }
        cells = [
            [*_cell(step, f"heldout_{name}_m", factor, unit), *multiples[name]]
            for name in METRICS
        ]
        train = factor * step["train_rms_m"]
        row = {
            "name": say.in_words(step["step"]),
            "kind": step["kind"],
            "parameters": str(int(step["parameters"])),
        }
        rows.append(
            row
            | {
                "training": f"{train:.3f}" if unit == "mm" else f"{train:.0f}",
                "cells": cells,
            }
        )
    return {"unit": unit, "rows": rows}


def experiment_facts(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Table of the states proposed, angles in degrees."""
    if not rows:
        return {"loaded": False, "heads": [], "rows": [], "points": ""}
    angles = [name for name in rows[0] if re.fullmatch(r"q\d+", name)]
    loads = {"fx": "N", "fy": "N", "fz": "N", "mx": "N·m", "my": "N·m", "mz": "N·m"}
    # There are no columns of loads where all states are unloaded.
    loads = loads if any(row[name] for row in rows for name in loads) else {}
    shown = []
    for row in rows:
        cells = [
            *(f"{np.degrees(row[name]):.1f}" for name in angles),
            *(f"{round(row[name])}" for name in loads),
        ]
        shown.append(
            [
                say.minus(cell)
                for cell in (
                    *cells,
                    say.plain(row["separation"]),
                    say.percent(row["resolved"]),
                )
            ]
        )
    heads = [
        *(f"{name} °" for name in angles),
        *(f"{name} {unit}" for name, unit in loads.items()),
        "separation",
        "resolved",
    ]
    return {
        "loaded": bool(loads),
        "heads": heads,
        "rows": shown,
        "points": say.listed(rows[0]["point"].split()),
    }


def measured_rows(
    table: Mapping[str, np.ndarray], descriptions: Mapping[str, Any]
) -> list[list[str]]:
    """Rows of what was measured: name, at fitted poses, at validation poses."""
    held_out = table["held_out"].astype(bool)
    campaigns = [
        descriptions["campaign"],
        (descriptions["held_out"] or descriptions)["campaign"],
    ]
    masks = zip((~held_out, held_out), campaigns, strict=True)
    parts = [
        _part({name: values[mask] for name, values in table.items()}, campaign)
        for mask, campaign in masks
    ]
    return [[name, *(part[name] for part in parts)] for name in parts[0]]


def _part(
    part: Mapping[str, np.ndarray], campaign: Mapping[str, Any]
) -> dict[str, str]:
    """What was measured in one part of the measurements."""
    if not len(part["pose"]):
        return dict.fromkeys(("campaign", "measurements"), "none")

    def distinct(*names: str) -> np.ndarray:
        """How often each combination of values of some columns occurs."""
        return np.unique(
            np.column_stack([part[name] for name in names]), axis=0, return_counts=True
        )[1]

    each = distinct("session", "pose", "load", "target")
    oriented = campaign["measured"] == "pose"
    force = np.linalg.norm([part[name] for name in ("fx", "fy", "fz")], axis=0)
    loaded = force[force > 0]
    loads = "none"
    targets = list(campaign["targets"].items())
    if len(loaded):
        same = np.isclose(loaded.min(), loaded.max(), rtol=1e-3)
        ends = " to ".join(
            map(say.plain, [loaded.min()] if same else [loaded.min(), loaded.max()])
        )
        numbers = format_count(len(np.unique(part["load"][force > 0])), "load")
        loads = f"{numbers} of {ends} N on {say.percent(len(loaded) / len(force))} of the measurements"
    used = [
        ("" if name == target["point"] else f"{name} ")
        + f"at the measuring point {target['point']}{_mount(target, oriented)}"
        for name, target in (targets[number] for number in np.unique(part["target"]))
    ]
    return {
        "campaign": campaign["campaign"],
        "measurements": f"{format_integer(len(force))}, each a {'position and orientation' if oriented else 'position'}",
        "poses": f"{format_count(len(distinct('session', 'pose')), 'pose')} in {format_count(len(distinct('session')), 'session')}",
        "states (pose and load)": format_integer(
            len(distinct("session", "pose", "load"))
        ),
        "loads": loads,
        "targets": say.listed(used, 12),
        "repeats of a state": str(each.min())
        if each.min() == each.max()
        else f"{each.min()} to {each.max()}, median {np.median(each):g}",
        "coordinate frame": "the tracker's; its placement is fitted"
        if campaign["frame"] == "tracker"
        else "the base's",
        "time": "recorded" if np.isfinite(part["time_s"]).any() else "not recorded",
    }


def _mount(target: Mapping[str, Any], oriented: bool) -> str:
    """What is fitted of how a target sits, and a known turn of its mount."""
    rotation = target.get("rotation", target["offset_m"]) if oriented else ""
    fitted = [
        word
        for word, value in (("place", target["offset_m"]), ("rotation", rotation))
        if value == "unknown"
    ]
    known = (
        "rotation" in target and oriented and rotation != "unknown" and any(rotation)
    )
    turned = f", turned by {np.degrees(np.linalg.norm(rotation)):.4g}°" if known else ""
    return turned + (f", {' and '.join(fitted)} fitted" if fitted else "")


def compliance_rows(compliance: Mapping[str, Sequence[float]]) -> list[list[str]]:
    """Rows of the compliances: joint, before, after with its standard error; no number
    of one that is not identifiable."""
    rows = []
    columns = zip(
        *(compliance[name] for name in ("before", "after", "std_error")), strict=True
    )
    identified = any(compliance["std_error"])
    for joint, (before, after, error) in enumerate(columns, 1):
        if identified and not error:
            rows.append([str(joint), *["not identifiable"] * 2])
            continue
        stated = say.pm(after, error) if error else f"{after:.4g}"
        decimals = len(stated.rpartition(".")[2]) if "." in stated else 0
        rows.append(
            [str(joint), f"{before:.{decimals}f}" if error else f"{before:.4g}", stated]
        )
    return rows


def held_rows(held: Iterable[str]) -> list[list[str]]:
    """Parameters that the measurements do not determine, one row for each owner."""
    owners: dict[str, list[str]] = {}
    for owner, _, parameter in (name.rpartition(" ") for name in held):
        owners.setdefault(owner, []).append(
            say.parameter_words(effect_of(owner), parameter)
        )
    return [
        [say.capital(say.candidate_words(owner)), ", ".join(names)]
        for owner, names in owners.items()
    ]


def left_to_priors(parameters: Mapping[str, np.ndarray]) -> list[str]:
    """Parameters about which the measurements say hardly more than their priors: owner
    and name, as in ``held``."""
    mine = (
        parameters["std_error"] > MOSTLY_PRIOR * parameters["prior_std"]
    ) & ~parameters["held"].astype(bool)
    return [
        f"{owner} {name}"
        for owner, name in zip(
            parameters["owner"][mine], parameters["parameter"][mine], strict=True
        )
    ]


def untestable_rows(untestable: Mapping[str, str]) -> list[list[str]]:
    """Candidates that were not tested, by their reasons, one row for each effect and
    reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for key, reason in untestable.items():
        found.setdefault(
            (effect_of(key), reason.replace("no approach", "no direction of approach")),
            [],
        ).append(key)
    rows = []
    for (effect, reason), keys in found.items():
        where = say.place_words(keys)
        if len(where) > _LONGEST:
            where = f"{say.place_words(keys[:_SHOWN])} and {len(keys) - _SHOWN} more"
        rows.append([say.capital(say.physical_name(effect)), where or "–", reason])
    return sorted(rows, key=lambda row: (row[2], row[0]))
