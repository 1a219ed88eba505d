"""Collect the facts of a campaign's report, for the PDF and the page: rows of tables, and
the sentences of `campaign.txt`."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from elastocal import __version__
from elastocal.application.statements import describe_left_out, tabulate_errors
from elastocal.counting import format_integer, pluralize
from elastocal.diagnosis.hypotheses import OTHER, RELATED
from elastocal.effects.catalogue import list_effects
from elastocal.effects.protocol import effect_of
from elastocal.report import words as say
from elastocal.report.measured import tabulate_measured
from elastocal.report.typesetting import render_sentences
from elastocal.verdict import DataFault, Effect, EffectParameter

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

    from elastocal.io.storage import Columns, Row
    from elastocal.verdict import (
        Compliances,
        FaultValue,
        HeldOut,
        RepeatableResidual,
        Verdict,
    )

TITLES = {
    "adequate": "the declared model is adequate",
    "named": "one mechanism is missing in the declared model",
    "class": "one mechanism is missing in the declared model; which one is ambiguous",
    "several": "several mechanisms are missing in the declared model",
    "unexplained": "the declared model lacks something that is not in the catalogue",
    "not_testable": "these measurements can test no mechanism",
}
# Verdicts that name effects.
_NAMING = ("named", "class", "several")
# Title of several mechanisms of which at most one is more probable than not.
UNCERTAIN_COUNT = "mechanisms are missing in the declared model; how many is uncertain"
AT_FAULT = "the data are at fault"
# Appended to a title if a part of the residual is a function of the joints.
AND_MORE = "; a further error has no known cause"
# Sections of the template that are lists of sentences; the others are one paragraph.
_LISTS = (
    "sentences",
    "now",
    "warnings",
    "headline",
    "accuracy",
    "noise",
    "method",
)
# Causes and locations below this probability are not shown.
_MIN_SHOWN_PROBABILITY = 0.01
# From this probability on, a location is stated without its alternatives, and a cause
# counts as real.
_CERTAIN = 0.95
# Upper bound on the causes on page 1 that are not part of the verdict.
_MAX_OTHER_CAUSES = 6
# A cause is negligible below this share of the corrected robot's error: squares add up,
# so that leaving it uncorrected raises the error by 5 % at most. Ellison, S. L. R. and
# Williams, A. (eds.), EURACHEM/CITAC Guide CG 4, 2012, section 7.2.2: components below
# a third of the largest need no closer look.
NEGLIGIBLE = 1 / 3
# A cost is printed to a micrometre.
_COST_RESOLUTION_M = 1e-6
# Limits of the tables, so that they do not fill pages; the files have everything.
_MAX_NAMES = 8
_MAX_PARAMETERS = 16
_SHOWN_PARAMETERS = 10
METRICS = ("mean", "rms", "p95", "max")
# Above this ratio of the standard error to that of the prior, the measurements say
# hardly more about a parameter than its prior does.
MOSTLY_PRIOR = 0.7
# A list of locations that is longer than this is cut to its first entries.
_MAX_LOCATION_LETTERS = 100
_SHOWN_LOCATIONS = 4


def format_title(
    verdict: str, likely: int, repeatable: RepeatableResidual | None
) -> str:
    """Return a verdict in one line; it mentions a repeatable residual.

    Parameters
    ----------
    verdict : str
        One of the six verdicts.
    likely : int
        Number of missing effects that are more probable than not.
    repeatable : RepeatableResidual or None
        Part of the residual that is a function of the joints.
    """
    title = TITLES[verdict]
    if verdict == "several" and likely < 2:
        title = UNCERTAIN_COUNT
    remains = repeatable is not None and repeatable.remains
    return title + (AND_MORE if verdict in _NAMING and remains else "")


def render_campaign_sentences(
    verdict: Verdict,
    steps: Sequence[Row] = (),
    experiment: Sequence[Row] = (),
    descriptions: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Render the sentences of `campaign.txt` on a campaign, by headings.

    Parameters
    ----------
    verdict : Verdict
        The verdict.
    steps, experiment : sequence of mappings
        Rows of before_after.csv and of next_experiment.csv.
    descriptions : mapping, optional
        Contents of campaign.json; without them nothing is stated of the method.
    """
    effects = [
        describe_effect(effect, verdict.heldout) for effect in verdict.missing_effects
    ]
    return render_sentences(
        "campaign.txt",
        say.FILTERS,
        verdict=verdict,
        descriptions=descriptions,
        effects=effects,
        faulty=bool(verdict.faults),
        accuracy=verdict.accuracy,
        left_out=describe_left_out(verdict),
        ends=[_format_interval(step) for step in steps if step["kind"] != "frames"],
        new_poses=len({(row["effect"], row["pose"]) for row in experiment}),
        version=__version__,
    )


def collect_loop_facts(
    verdict: Verdict,
    steps: Sequence[Row],
    experiment: Sequence[Row],
    table: Columns,
    descriptions: Mapping[str, Any],
    parameters: Columns,
) -> dict[str, Any]:
    """Return the facts of the report of a campaign.

    Parameters
    ----------
    verdict : Verdict
        The verdict.
    steps, experiment : sequence of mappings
        Rows of before_after.csv and of next_experiment.csv.
    table, parameters : mapping of (N,) arrays
        Columns of the residuals, and of the parameters of the final model.
    descriptions : mapping
        Contents of campaign.json.

    Returns
    -------
    dict
        JSON-serialisable: strings ready to print, and lists for tables.
    """
    heldout = verdict.heldout
    faulty = bool(verdict.faults)
    stated = render_campaign_sentences(verdict, steps, experiment, descriptions)
    paragraphs = {
        name: lines if name in _LISTS else " ".join(lines)
        for name, lines in stated.items()
    }
    effects = [describe_effect(effect, heldout) for effect in verdict.missing_effects]
    faults = [describe_fault(fault) for fault in verdict.faults]
    likely = sum(effect.is_likely for effect in verdict.missing_effects)
    title = format_title(verdict.verdict, likely, verdict.repeatable)
    return {
        **paragraphs,
        "method": dict(stated["method"]),
        "campaign": verdict.campaign,
        "robot": descriptions["robot"]["name"],
        "verdict": AT_FAULT if faulty else title,
        "faulty": faulty,
        "headline": dict(stated["headline"]) or None,
        "causes": [] if verdict.verdict == "not_testable" else tabulate_causes(verdict),
        "errors": tabulate_errors(verdict),
        "measured": tabulate_measured(table, descriptions),
        "floor": say.format_length(heldout.noise_floor_rms_m),
        "steps": tabulate_steps(steps, heldout.noise_floor_rms_m),
        "effects": faults or effects,
        "experiment": tabulate_experiment(experiment),
        "compliances": tabulate_compliances(verdict.compliance_urad_per_Nm),
        "compliances_identified": any(verdict.compliance_urad_per_Nm.std_error),
        "held": tabulate_undetermined(_list_undetermined(verdict, parameters)),
        "untestable": tabulate_untestable(verdict.untestable),
        "found": [effect.name for effect in verdict.effects],
    }


def _list_undetermined(verdict: Verdict, parameters: Columns) -> list[str]:
    """Return the parameters that the measurements do not determine, without those that
    the search has chosen."""
    chosen_by_search = {
        parameter.name
        for effect in verdict.missing_effects
        for parameter in effect.parameters
        if parameter.shape
    }
    held = [name for name in verdict.held if name not in chosen_by_search]
    return held + find_prior_dominated(parameters)


def format_cost(effect: Effect, heldout: HeldOut) -> str:
    """Return the contribution of an effect in words.

    Its cost is the RMS error at the campaign's poses and loads if the effect alone were
    left out of the correction.

    Parameters
    ----------
    effect : Effect
        An effect that was found.
    heldout : HeldOut
        Errors of the validation poses.
    """
    cost_m = effect.cost_m
    if cost_m is None:
        definition = list_effects().get(effect.name)
        if definition is None or definition.moves_robot:
            return "cannot be corrected"
        return "an error of the measurement, not of the robot"
    if cost_m > NEGLIGIBLE * heldout.after.rms_m:
        return f"{say.format_millimetres(cost_m)} mm"
    size = say.format_millimetres(cost_m)
    if cost_m < _COST_RESOLUTION_M / 2:
        # An effect that was found must not be printed as zero.
        size = f"below {say.format_millimetres(_COST_RESOLUTION_M)}"
    certainty = "real, " if effect.probability >= _CERTAIN else ""
    return f"{size} mm: {certainty}negligible"


def tabulate_causes(verdict: Verdict) -> list[dict[str, Any]]:
    """Return the possible causes, the most probable one first.

    Each row has the cause in words, its probability and, if it was found, its cost and
    its gain at the validation poses. Mechanisms may act together, so probabilities need
    not add up to one.
    """
    if verdict.probabilities is None:
        return []
    rows = [
        _make_cause_row(
            say.format_found_effect(effect.name, effect.members),
            effect.probability,
            format_cost(effect, verdict.heldout),
            effect.heldout_gain,
        )
        for effect in verdict.missing_effects
    ]
    rows += [
        _make_cause_row(name, probability)
        for name, probability in _list_other_causes(verdict)
    ]
    return sorted(rows, key=lambda row: -row["probability"])


def _make_cause_row(
    name: str, probability: float, cost: str = "", gain: float | None = None
) -> dict[str, Any]:
    """Return the row of a possible cause; one that was found has a cost, and a gain if
    it is known."""
    return {
        "name": say.capitalize_first(name),
        "probability": probability,
        "words": say.format_probability(probability),
        "cost": cost,
        "gain": "" if gain is None else say.set_minus(f"{-100 * gain:+.0f} %"),
    }


def _list_other_causes(verdict: Verdict) -> list[tuple[str, float]]:
    """Return probable causes that are not part of the verdict, the most probable
    first."""
    assert verdict.probabilities is not None
    missing = {effect.name for effect in verdict.missing_effects}
    # Together with a missing mechanism, the competitor is a related mechanism.
    competitor = RELATED if missing else say.UNKNOWN
    causes = []
    for name, probability in verdict.probabilities.mechanisms.items():
        if name not in missing:
            cause = competitor if name == OTHER else say.name_effect(name)
            causes.append((cause, probability))
    causes.append((say.NOTHING, verdict.probabilities.nothing))
    shown = [cause for cause in causes if cause[1] >= _MIN_SHOWN_PROBABILITY]
    shown.sort(key=lambda cause: -cause[1])
    return shown[:_MAX_OTHER_CAUSES]


def describe_effect(effect: Effect, heldout: HeldOut) -> dict[str, Any]:
    """Return the facts of an effect.

    Parameters
    ----------
    effect : Effect
        An effect that was found.
    heldout : HeldOut
        Errors of the validation poses.
    """
    found = say.format_found_effect(effect.name, effect.members)
    probability = say.format_probability(effect.probability)
    cost = format_cost(effect, heldout)
    identifiable = [entry for entry in effect.parameters if entry.identifiable]
    shown = _select_parameters(identifiable)
    rows = [_effect_parameter_row(entry, effect.members) for entry in shown]
    locations = [
        (
            say.format_location(effect.name, entry.location),
            say.format_probability(entry.probability),
        )
        for entry in effect.locations
        if entry.probability >= _MIN_SHOWN_PROBABILITY
    ]
    alternatives = [say.format_alternative(name) for name in effect.alternatives]
    left_out = ""
    if len(identifiable) > len(shown):
        left_out = format_integer(len(identifiable))
    return {
        "name": say.capitalize_first(say.name_effect(effect.name)),
        "found": found,
        "bare": say.name_effect(effect.name),
        "catalogue": effect.name,
        "family": effect.family,
        "description": say.format_sentence(summarize_effect(effect.name)),
        "locations": locations if len(effect.locations) > 1 else [],
        "unsure": _list_uncertain_locations(effect, locations),
        "parameters": rows,
        "with_prior": any(entry.prior_std for entry in shown),
        "left_out": left_out,
        "with_angle": any("q)" in row[0] for row in rows),
        "held": len(effect.parameters) - len(identifiable),
        "probability": probability,
        "is_likely": effect.is_likely,
        "stated": f"{found} ({probability}; {cost})",
        "cost": cost,
        "cost_m": effect.cost_m,
        "gain": effect.heldout_gain,
        "adopted": effect.adopted,
        "common": say.find_common_kind(effect.name, effect.alternatives),
        "evidence": [],
        **_list_alternatives(alternatives),
    }


def _list_alternatives(alternatives: Sequence[str]) -> dict[str, str]:
    """Return alternatives as lists with "and" and with "or"; empty if there are none."""
    if not alternatives:
        return {"alternatives": "", "instead": ""}
    return {
        "alternatives": say.join_items(alternatives, _MAX_NAMES),
        "instead": say.join_items(alternatives, _MAX_NAMES, last="or"),
    }


def _list_uncertain_locations(
    effect: Effect, locations: Sequence[tuple[str, str]]
) -> list[str]:
    """Return the locations of an effect with their probabilities, unless one of them is
    certain or the effect acts at several."""
    probabilities = [entry.probability for entry in effect.locations]
    is_certain = not locations or probabilities[0] >= _CERTAIN
    if is_certain or len(effect.members) > 1:
        return []
    return [f"{location} ({probability})" for location, probability in locations]


def _select_parameters(parameters: list[EffectParameter]) -> list[EffectParameter]:
    """Return all parameters, or of very many the most significant ones."""
    if len(parameters) <= _MAX_PARAMETERS:
        return parameters
    ranked = sorted(
        parameters,
        key=lambda entry: -abs(entry.value) / entry.std_error if entry.std_error else 0,
    )
    return ranked[:_SHOWN_PARAMETERS]


# Facts of an effect that a fault of the data does not have.
_NO_EFFECT_FACTS = {
    "catalogue": "",
    "locations": [],
    "unsure": [],
    "with_prior": False,
    "left_out": "",
    "with_angle": False,
    "held": 0,
    "probability": "",
    "cost": "",
    "cost_m": None,
    "gain": None,
    "adopted": False,
}


def describe_fault(fault: DataFault) -> dict[str, Any]:
    """Return the facts of a fault of the data, with the keys of `describe_effect`."""
    name = say.capitalize_first(say.split_underscores(fault.name))
    if fault.joints:
        noun = pluralize("joint", len(fault.joints))
        name += f" of {noun} {say.join_items(map(str, fault.joints))}"
    # RMS distance between measured and predicted positions, as written and with the
    # correction.
    evidence = []
    if len(fault.evidence) == 2 and None not in fault.evidence:
        evidence = [say.format_length(distance) for distance in fault.evidence]
    return {
        **_NO_EFFECT_FACTS,
        "name": name,
        "found": say.format_found_effect(fault.name, ()),
        "bare": say.name_effect(fault.name),
        "family": fault.family,
        "description": say.format_sentence(fault.detail),
        "parameters": [_fault_value_row(entry) for entry in fault.parameters],
        "common": say.find_common_kind(fault.name, fault.alternatives),
        "evidence": evidence,
        **_list_alternatives(fault.alternatives),
    }


def _format_interval(step: Row) -> str:
    """Return the RMS error of a step on validation poses with its 95 % interval, in one
    unit."""
    factor, unit = say.choose_length_unit(step["heldout_rms_m"])
    text = say.format_number(factor * step["heldout_rms_m"])
    low = factor * step["heldout_rms_m_low"]
    high = factor * step["heldout_rms_m_high"]
    if np.isfinite([low, high]).all():
        text += f" [{say.format_number(low)}, {say.format_number(high)}]"
    return f"{text}\u00a0{unit}"


def summarize_effect(effect: str) -> str:
    """Return the first paragraph of an effect's docstring without its formula."""
    definition = list_effects().get(effect)
    summary = say.split_underscores(effect)
    if definition and definition.doc:
        paragraph, *_ = definition.doc.strip().split("\n\n")
        summary = " ".join(paragraph.split())
    return re.sub(r", \w+\([^,]*=.*$", "", summary.split(":")[0]).rstrip(".")


def _effect_parameter_row(
    parameter: EffectParameter, members: Sequence[str]
) -> list[str]:
    """Return name, value, unit and source of a parameter of an effect."""
    # Keys may have blanks, and one may begin another: the longest one is meant.
    matching = [key for key in members if parameter.name.startswith(f"{key} ")]
    member = max(matching, key=len, default="")
    # A quantity of the whole effect, such as its largest sag, belongs to no member.
    owner = member or effect_of(members[0])
    name = say.name_parameter(
        effect_of(owner), parameter.name.removeprefix(f"{owner} ")
    )
    if member and len(members) > 1:
        name = f"{say.format_places([member])}: {name}"
    source = ""
    if parameter.std_error:
        source = "measurements"
    elif parameter.shape:
        source = "the best of those tried"
    return [name, *_format_value(parameter), source]


def _fault_value_row(value: FaultValue) -> list[str]:
    """Return name, value and unit of a number that describes a fault of the data."""
    return [say.split_underscores(value.name), *_format_value(value), ""]


def _format_value(entry: EffectParameter | FaultValue) -> tuple[str, str]:
    """Return a value with its standard error, and its unit."""
    number, unit = say.format_with_unit(entry.value, entry.std_error, entry.unit)
    if entry.unit == "–" and float(entry.value).is_integer():
        number = format_integer(int(entry.value))
    return number, unit


def _cell(row: Row, name: str, factor: float, unit: str) -> list[str]:
    """Return a value and its interval as the lines of a cell."""
    number = _format_length(factor * row[name], unit)
    low = factor * row[f"{name}_low"]
    high = factor * row[f"{name}_high"]
    if np.isnan(low) or np.isnan(high):
        return [number, "–"]
    return [number, f"[{_format_length(low, unit)}, {_format_length(high, unit)}]"]


def _format_length(length: float, unit: str) -> str:
    """Return a length of a table: micrometres whole, millimetres with three decimals."""
    if unit == "mm":
        return f"{length:.3f}"
    return say.set_minus(f"{length:.0f}") if np.isfinite(length) else ""


def tabulate_steps(steps: Sequence[Row], floor_m: float | None) -> dict[str, Any]:
    """Return the table of errors before and after, with its unit.

    Parameters
    ----------
    steps : sequence of mappings
        Rows of before_after.csv.
    floor_m : float or None
        RMS error of the noise alone.

    Returns
    -------
    dict
        ``unit`` and ``rows``; each error is a list of lines: value, interval, multiple
        of the noise floor.
    """
    factor, unit = say.choose_length_unit(max(step["heldout_max_m"] for step in steps))
    rows = []
    for step in steps:
        cells = []
        for metric in METRICS:
            cell = _cell(step, f"heldout_{metric}_m", factor, unit)
            if floor_m:
                cell.append(f"{step[f'heldout_{metric}_over_floor']:.2f} × floor")
            cells.append(cell)
        rows.append(
            {
                "name": say.spell_out_names(step["step"]),
                "kind": step["kind"],
                "parameters": str(int(step["parameters"])),
                "training": _format_length(factor * step["train_rms_m"], unit),
                "cells": cells,
            }
        )
    return {"unit": unit, "rows": rows}


def tabulate_experiment(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the table of the proposed states, with angles in degrees."""
    if not rows:
        return {"loaded": False, "heads": [], "rows": [], "points": ""}
    angles = [name for name in rows[0] if re.fullmatch(r"q\d+", name)]
    loads = {"fx": "N", "fy": "N", "fz": "N", "mx": "N·m", "my": "N·m", "mz": "N·m"}
    # Without loads the table has no columns for them.
    if not any(row[name] for row in rows for name in loads):
        loads = {}
    shown = []
    for row in rows:
        cells = [f"{np.degrees(row[name]):.1f}" for name in angles]
        cells += [f"{round(row[name])}" for name in loads]
        cells += [
            say.format_number(row["separation"]),
            say.format_percent(row["resolved"]),
        ]
        shown.append([say.set_minus(cell) for cell in cells])
    heads = [f"{name} °" for name in angles]
    heads += [f"{name} {unit}" for name, unit in loads.items()]
    return {
        "loaded": bool(loads),
        "heads": [*heads, "separation", "resolved"],
        "rows": shown,
        "points": say.join_items(rows[0]["point"].split()),
    }


def tabulate_compliances(compliances: Compliances) -> list[list[str]]:
    """Return joint, compliance before, and after with its standard error; a compliance
    that is not identifiable has no number."""
    rows = []
    identified = any(compliances.std_error)
    for joint, (before, after, error) in enumerate(
        zip(compliances.before, compliances.after, compliances.std_error, strict=True),
        1,
    ):
        if not error:
            numbers = ["not identifiable"] * 2
            if not identified:
                numbers = [f"{before:.4g}", f"{after:.4g}"]
            rows.append([str(joint), *numbers])
            continue
        estimate = say.format_estimate(after, error)
        decimals = len(estimate.rpartition(".")[2]) if "." in estimate else 0
        rows.append([str(joint), f"{before:.{decimals}f}", estimate])
    return rows


def tabulate_undetermined(held: Iterable[str]) -> list[list[str]]:
    """Return the parameters that the measurements do not determine, one row for each
    owner."""
    names_by_owner: dict[str, list[str]] = {}
    for key in held:
        owner, _, parameter = key.rpartition(" ")
        name = say.name_parameter(effect_of(owner), parameter)
        names_by_owner.setdefault(owner, []).append(name)
    return [
        [say.capitalize_first(say.format_candidate(owner)), ", ".join(names)]
        for owner, names in names_by_owner.items()
    ]


def find_prior_dominated(parameters: Columns) -> list[str]:
    """Return the parameters about which the measurements say hardly more than their
    priors: owner and name."""
    is_wide = parameters["std_error"] > MOSTLY_PRIOR * parameters["prior_std"]
    selected = is_wide & ~parameters["held"].astype(bool)
    owners = parameters["owner"][selected]
    names = parameters["parameter"][selected]
    return [f"{owner} {name}" for owner, name in zip(owners, names, strict=True)]


def tabulate_untestable(untestable: Mapping[str, str]) -> list[list[str]]:
    """Return the candidates that were not tested, one row for each effect and reason."""
    keys_by_cause: dict[tuple[str, str], list[str]] = {}
    for key, reason in untestable.items():
        cause = reason.replace("no approach", "no direction of approach")
        keys_by_cause.setdefault((effect_of(key), cause), []).append(key)
    rows = []
    for (effect, reason), keys in keys_by_cause.items():
        locations = say.format_places(keys)
        if len(locations) > _MAX_LOCATION_LETTERS:
            first = say.format_places(keys[:_SHOWN_LOCATIONS])
            locations = f"{first} and {len(keys) - _SHOWN_LOCATIONS} more"
        name = say.capitalize_first(say.name_effect(effect))
        rows.append([name, locations or "–", reason])
    return sorted(rows, key=lambda row: (row[2], row[0]))
