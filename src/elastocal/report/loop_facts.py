"""Everything that the report of a campaign states, worded, from the files that the loop wrote."""

import re
from collections import Counter

import numpy as np

from elastocal.effects.catalogue import effects
from elastocal.figures.candidates import FAMILY_WISE_LEVEL
from elastocal.report.wording import (
    MICRO,
    MILLI,
    at_joints,
    candidate_words,
    counted,
    grouped,
    length,
    listed,
    members_words,
    p_words,
    percent,
    plain,
    scaled,
    step_words,
    words,
)

METRICS = ("mean", "rms", "p95", "max")
TITLES = {
    "adequate": "adequate, nothing is missing that these data could show",
    "named": "named, one effect is missing",
    "class": "class, one of a few effects is missing",
    "several": "several effects are missing",
    "unexplained": "unexplained, more is missing than the catalogue accounts for",
    "not_testable": "not testable, these data can show nothing",
}
NOISE_SOURCES = {
    "repeats": "The noise is taken from the differences between repeats of the same state.",
    "declared": "The noise is taken as the campaign declares it; there are too few repeats to check it.",
    "residual": "The noise is not known: with neither repeats nor a declared noise the residual itself was taken for it.",
}
_OF_DATA = "data"
# More than these would fill pages that nobody reads; the tables have them all.
_MOST_PARAMETERS, _SHOWN_PARAMETERS = 16, 10
_MOST_OTHERS = 40
_MOST_NAMES = 8


def loop_facts(verdict, steps, experiment, table, candidates, descriptions, parameters, replicates):
    """Facts for the report of a campaign.

    Parameters
    ----------
    verdict : dict
        Contents of verdict.json.
    steps, experiment : list of dict
        Rows of before_after.csv and next_experiment.csv.
    table, candidates, parameters : dict of str to ndarray
        Columns of the residuals, the candidates and the final parameters.
    descriptions : dict
        Contents of campaign.json.
    replicates : int
        Of the bootstrap behind the family-wise p-values.

    Returns
    -------
    dict
        JSON-serialisable; strings ready to print, lists for tables.
    """
    tested = len(set(candidates["candidate"][np.isfinite(candidates["p_value"])]))
    faulty = any(effect["family"] == _OF_DATA for effect in verdict["effects"])
    return {
        "campaign": verdict["campaign"],
        "robot": descriptions["robot"]["name"],
        "verdict": f"{verdict['verdict']}, the readings are at fault" if faulty else TITLES[verdict["verdict"]],
        "faulty": faulty,
        "sentences": sentences(verdict, tested),
        "warnings": verdict["warnings"],
        "held_out_sentence": _held_out_sentence(verdict, steps),
        "measured": measured(table, descriptions),
        "noise": noise_rows(verdict["noise"], descriptions["campaign"]["measured"] == "pose"),
        "noise_source": NOISE_SOURCES[verdict["noise"]["source"]],
        "floor": length(verdict["heldout"]["noise_floor_rms_m"]),
        "steps": step_rows(steps, verdict["heldout"]["noise_floor_rms_m"]),
        "controls": _controls(steps),
        "effects": [effect_facts(effect) for effect in verdict["effects"]],
        "experiment": experiment_facts(experiment),
        "compliances": compliance_rows(verdict["compliance_urad_per_Nm"]),
        "compliances_identified": any(verdict["compliance_urad_per_Nm"]["std_error"]),
        "held": held_rows(verdict["held"]),
        "others": _other_parameters(verdict, parameters),
        "method": _method(verdict, tested, len(set(candidates["candidate"])), descriptions, replicates),
        "found": [effect["name"] for effect in verdict["effects"]],
    }


def sentences(verdict, tested):
    """The verdict in plain words.

    Parameters
    ----------
    verdict : dict
        Contents of verdict.json.
    tested : int
        Candidates that these data could test.

    Returns
    -------
    list of str
    """
    said, found = verdict["verdict"], verdict["effects"]
    faults = [effect for effect in found if effect["family"] == _OF_DATA]
    if faults:
        return [
            f"The readings themselves are at fault ({listed(map(_named, faults))}).",
            *(_sentence(fault["detail"]) for fault in faults),
            "They must be corrected before anything can be traced; all that follows was made with the readings as they are.",
        ]
    before, after = (verdict["lack_of_fit"][stage] for stage in ("before", "after"))
    tested = counted(tested, "candidate")
    level = f"{100 * FAMILY_WISE_LEVEL:g} %"
    if said == "not_testable":
        return [
            "These data can test nothing: the declared model takes up everything that any effect of the catalogue would make.",
            "Neither that something is missing nor that nothing is can be said; more poses, loads or targets are needed.",
        ]
    if said == "adequate":
        return [
            f"The declared model describes these readings: none of {tested} stands out beyond chance (family-wise {level}).",
            _remainder(before, "The residual"),
        ]
    named = listed((_named(effect) for effect in found), _MOST_NAMES)
    if said == "unexplained":
        first = "The residual of the declared model is more than noise, and the catalogue does not account for it."
        if not found:
            return [
                first,
                f"None of {tested} stands out beyond chance (family-wise {level}).",
                _remainder(before, "The residual"),
            ]
        share = percent(verdict["lack_of_fit"]["explained_share"])
        second = (
            f"What stands out most, {named}, explains {share} of the mean square above the noise; too little to be the cause."
        )
        return [first, second, _remainder(after, "What remains")]
    last = _remainder(after, "What remains")
    if said == "several":
        return [f"The declared model lacks {counted(len(found), 'effect')}: {named}.", last]
    effect = found[0]
    if said == "class":
        others = [candidate_words(key) for key in effect["alternatives"]]
        doubted = dict.fromkeys(doubt["departure"] for doubt in effect["doubts"])
        akin = f"something akin to it, for it departs from its law: {listed(doubted, _MOST_NAMES)}"
        confused = f"one that these data cannot tell from it: {listed(others, _MOST_NAMES)}"
        either = ", or ".join(part for part, there in ((confused, others), (akin, doubted)) if there)
        return [
            f"The declared model lacks one effect: {named}, or {either}.",
            "Which of them it is takes another experiment; the errors below fall all the same.",
            last,
        ]
    first = f"The declared model lacks one effect: {named}."
    if effect["alternatives"]:
        places = listed([candidate_words(key) for key in effect["alternatives"]], _MOST_NAMES)
        return [first, f"These data show it, but not where: instead it may be {places}.", last]
    nearest = effect["angle_to_nearest_deg"]
    told = f", and tell it from every other candidate (the nearest lies {nearest:.0f}° off)" if nearest is not None else ""
    return [first, f"These data show it{told}.", last]


def measured(table, descriptions):
    """Rows of what was measured: name, training, held out.

    Parameters
    ----------
    table : dict of str to ndarray
        Columns of the residuals table.
    descriptions : dict
        Contents of campaign.json.

    Returns
    -------
    list of list of str
    """
    held_out = table["held_out"].astype(bool)
    campaigns = [descriptions["campaign"], (descriptions["held_out"] or descriptions)["campaign"]]
    parts = [
        _part({name: values[mask] for name, values in table.items()}, campaign)
        for mask, campaign in zip((~held_out, held_out), campaigns, strict=True)
    ]
    return [[name, *(part[name] for part in parts)] for name in parts[0]]


def noise_rows(noise, with_orientation):
    """Rows of the noise: name, value with unit."""
    rows = [["sensor, each component of a position", length(noise["position_m"])]]
    if with_orientation:
        rows.append(["sensor, each component of an orientation", f"{plain(MICRO * noise['orientation_rad'])} µrad"])
    if any(noise["joint_rad"]):
        rows += [
            [f"repeatability of joint {joint}", f"{plain(MICRO * value)} µrad"]
            for joint, value in enumerate(noise["joint_rad"], 1)
        ]
    if noise["degrees_of_freedom"]:
        rows.append(["contrasts between repeats behind it", grouped(noise["degrees_of_freedom"])])
    return rows


def step_rows(steps, floor_m):
    """Rows of the table before and after; each error as a list of lines: value, interval, multiple of the noise floor."""
    largest = max(step["heldout_max_m"] for step in steps)
    factor, unit = (MILLI, "mm") if largest >= 1e-3 else (MICRO, "µm")
    digits = (lambda value: f"{factor * value:.3f}") if unit == "mm" else (lambda value: f"{factor * value:.0f}")
    rows = []
    for step in steps:
        cells = []
        for metric in METRICS:
            low, high = (step[f"heldout_{metric}_m_{end}"] for end in ("low", "high"))
            multiple = [f"{step[f'heldout_{metric}_over_floor']:.2f} × floor"] if floor_m else []
            interval = "–" if np.isnan(low) else f"≥ {digits(low)}" if np.isinf(high) else f"[{digits(low)}, {digits(high)}]"
            cells.append([digits(step[f"heldout_{metric}_m"]), interval, *multiple])
        name, number = step_words(step["step"]), str(int(step["parameters"]))
        rows.append(
            {"name": name, "kind": step["kind"], "parameters": number, "training": digits(step["train_rms_m"]), "cells": cells}
        )
    return {"unit": unit, "rows": rows}


def effect_facts(effect):
    """What the report says of one effect or fault of the data."""
    known = [entry for entry in effect["parameters"] if not entry.get("held")]
    rest = ""
    shown = known
    if len(known) > _MOST_PARAMETERS:
        shown = sorted(known, key=_distance_from_zero, reverse=True)[:_SHOWN_PARAMETERS]
        rest = (
            f"The {len(shown)} of {grouped(len(known))} parameters that lie farthest from zero, in standard errors; "
            "final_parameters.parquet has them all."
        )
    members = effect.get("members", [])
    held = len(effect["parameters"]) - len(known)
    gain = effect["heldout_gain"]
    return {
        "name": _capital(words(effect["name"])) + at_joints(effect["name"], effect["joints"]),
        "family": effect["family"],
        "description": _sentence(effect.get("detail") or description(effect["name"])),
        "members": members_words(members) if len(members) > 1 else "",
        "parameters": [_parameter_row(entry, members) for entry in shown],
        "rest": rest,
        "held": f"{counted(held, 'parameter')} of it cannot be told with these data." if held else "",
        "p": "" if effect["p_value"] is None else p_words(effect["p_value"]),
        "gain": "" if gain is None else _gain(gain),
        "alternatives": listed(map(candidate_words, effect["alternatives"]), 2 * _MOST_NAMES) if effect["alternatives"] else "",
        "nearest": "" if effect["angle_to_nearest_deg"] is None else f"{effect['angle_to_nearest_deg']:.0f}°",
    }


def description(effect):
    """What an effect of the catalogue is, in the words of its module, without the formula."""
    module = effects().get(effect)
    summary = module.__doc__.split("\n\n")[0].replace("\n", " ") if module else words(effect)
    return re.sub(r", \w+\([^,]*=.*$", "", summary.split(":")[0]).rstrip(".")


def experiment_facts(rows):
    """Table of the states proposed, angles in degrees; empty where nothing is confounded."""
    if not rows:
        return {"loaded": False, "heads": [], "rows": [], "gains": []}
    angles = [name for name in rows[0] if re.fullmatch(r"q\d+", name)]
    loads = {"fx": "N", "fy": "N", "fz": "N", "mx": "N·m", "my": "N·m", "mz": "N·m"}
    # Nothing is said of loads where all states are unloaded.
    loads = loads if any(row[name] for row in rows for name in loads) else {}
    heads = ["point", *(f"{name} °" for name in angles), *(f"{name} {unit}" for name, unit in loads.items()), "worth"]
    several = len({row["effect"] for row in rows}) > 1
    shown, gains = [], []
    for row in rows:
        cells = [row["point"], *(f"{np.degrees(row[name]):.1f}" for name in angles)]
        cells += [f"{round(row[name])}" for name in loads]
        # A worth is a ratio of separations, which starts at one.
        cells.append(f"{row['separation'] / row['separation_without']:.2f}" if row["separation_without"] > 0 else "–")
        shown.append(([words(row["effect"])] if several else []) + [_minus(cell) for cell in cells])
        last = (words(row["effect"]), plain(row["separation_without"]), plain(row["separation"]))
        gains = [gain for gain in gains if gain[0] != last[0]] + [last]
    heads = (["effect"] if several else []) + heads
    return {"loaded": bool(loads), "heads": heads, "rows": shown, "gains": [list(gain) for gain in gains]}


def compliance_rows(compliance):
    """Rows of the compliances: joint, before, after with its standard error."""
    rows = []
    for joint, (before, after, error) in enumerate(
        zip(*(compliance[name] for name in ("before", "after", "std_error")), strict=True), 1
    ):
        if not error:
            rows.append([str(joint), f"{before:.4g}", f"{after:.4g}"])
            continue
        decimals = max(0, 1 - int(np.floor(np.log10(error))))
        rows.append([str(joint), f"{before:.{decimals}f}", f"{after:.{decimals}f} ± {error:.{decimals}f}"])
    return rows


def held_rows(held):
    """Parameters that kept their values, one row for each owner."""
    owners = {}
    for name in held:
        owner, parameter = name.rsplit(" ", 1)
        owners.setdefault(owner, []).append(words(parameter))
    return [[candidate_words(owner), ", ".join(names)] for owner, names in owners.items()]


def _part(part, campaign):
    """What was measured in one part of the readings."""
    if not len(part["pose"]):
        return dict.fromkeys(("campaign", "readings"), "none")
    states = _distinct(part, "session", "pose", "load")
    repeats = Counter(map(tuple, np.column_stack([part[name] for name in ("session", "pose", "load", "target")])))
    each = np.array(list(repeats.values()))
    force = np.linalg.norm([part[name] for name in ("fx", "fy", "fz")], axis=0)
    loaded = force[force > 0]
    of_names = list(campaign["targets"].items())
    used = [of_names[number] for number in np.unique(part["target"])]
    kind = "position and orientation" if campaign["measured"] == "pose" else "position"
    frame = "the tracker's; its placement is fitted" if campaign["frame"] == "tracker" else "the base's"
    loads = "none"
    if len(loaded):
        ends = (
            [plain(loaded.min())]
            if np.isclose(loaded.min(), loaded.max(), rtol=1e-3)
            else map(plain, (loaded.min(), loaded.max()))
        )
        numbers = counted(len(np.unique(part["load"][force > 0])), "load")
        loads = f"{numbers} of {' to '.join(ends)} N on {percent(len(loaded) / len(force))} of the readings"
    return {
        "campaign": campaign["campaign"],
        "readings": f"{grouped(len(part['pose']))}, each a {kind}",
        "poses": counted(_distinct(part, "session", "pose"), "pose") + f" in {counted(_distinct(part, 'session'), 'session')}",
        "states (pose and load)": grouped(states),
        "loads": loads,
        "targets": listed(
            (
                f"{name} on {target['point']}" + (", place fitted" if target["offset_m"] == "unknown" else "")
                for name, target in used
            ),
            12,
        ),
        "repeats of a state": str(each.min())
        if each.min() == each.max()
        else f"{each.min()} to {each.max()}, median {np.median(each):g}",
        "frame of the readings": frame,
        "time": "recorded" if np.isfinite(part["time_s"]).any() else "not recorded",
    }


def _distinct(part, *names):
    return len(np.unique(np.column_stack([part[name] for name in names]), axis=0))


def _named(effect):
    return words(effect["name"]) + at_joints(effect["name"], effect["joints"])


def _remainder(fit, subject):
    ratio = fit["mean_square_over_noise"]
    if ratio is None:
        return f"{subject} cannot be held against the noise, which is not known."
    against = f"its mean square is {plain(ratio)} times that of the noise, {p_words(fit['p_value'])}"
    if fit["rejected"]:
        return f"{subject} is more than noise: {against}. Something else is still missing."
    return f"{subject} is no more than noise: {against}."


def _held_out_sentence(verdict, steps):
    held_out = verdict["heldout"]
    before, after = held_out["before"]["rms_m"], held_out["after"]["rms_m"]
    poses = counted(held_out["poses"], "pose")
    floor = held_out["noise_floor_rms_m"]
    noise = f" Noise alone leaves {length(floor)}." if floor else ""
    if not any(step["kind"] == "effect" for step in steps):
        return f"On {poses} that no step has seen the declared model leaves an RMS error of {length(after)}.{noise}"
    low, high = (100 * value for value in held_out["reduction_ci95"])
    fall = 100 * (1 - after / before)
    change = (
        f"falls from {length(before)} to {length(after)}, by {fall:.0f} %"
        if fall >= 0
        else f"grows from {length(before)} to {length(after)}, by {-fall:.0f} %"
    )
    interval = f"95 % interval of the fall: {_minus(f'{low:.0f}')} to {_minus(f'{high:.0f}')} %"
    return f"On {poses} that no step has seen the RMS error {change} ({interval}).{noise}"


def _controls(steps):
    controls = [step for step in steps if step["kind"] == "control"]
    after = [step for step in steps if step["kind"] in ("declared", "effect")][-1]
    if not controls:
        return ""
    declared = next(step for step in steps if step["kind"] == "declared")
    said = []
    for step in controls:
        more = counted(int(step["parameters"] - declared["parameters"]), "more parameter")
        said.append(f"{step_words(step['step']).removeprefix('control: ')} ({more}) leaves {length(step['heldout_rms_m'])}")
    return (
        "Negative controls are effects of other families that should not help, with as many parameters as those found where "
        f"there are so many. On the held-out poses {listed(said)}, against {length(declared['heldout_rms_m'])} of the declared "
        f"model and {length(after['heldout_rms_m'])} with what was found."
    )


def _gain(gain):
    return f"lowers the held-out RMS by {100 * gain:.0f} %" if gain >= 0 else f"raises the held-out RMS by {-100 * gain:.0f} %"


def _parameter_row(entry, members):
    # The longest, since keys may have blanks and one may begin another.
    member = max((key for key in members if entry["name"].startswith(f"{key} ")), key=len, default="")
    name = words(entry["name"].removeprefix(f"{member} "))
    where = f"{members_words([member])}: " if len(members) > 1 else ""
    return [where + name, *scaled(entry["value"], entry["std_error"], entry["unit"])]


def _distance_from_zero(entry):
    return abs(entry["value"]) / entry["std_error"] if entry["std_error"] else 0.0


def _other_parameters(verdict, parameters):
    """Estimates of the declared model beside the compliances, and how many there are of them, of frames and of targets."""
    mine = {member for effect in verdict["effects"] for member in effect.get("members", [])}
    rows, counts = [], Counter()
    columns = (parameters[name] for name in ("owner", "parameter", "value", "std_error", "unit", "held"))
    for owner, name, value, error, unit, held in zip(*columns, strict=True):
        if held or owner in mine or owner in ("fit", "joint_compliance"):
            continue
        kind = owner.split(" ")[0] if owner.startswith(("frame ", "target ")) else "declared"
        counts[kind] += 1
        if kind == "declared":
            rows.append([candidate_words(owner), words(name), *scaled(value, error, unit)])
    placed = counts["frame"] + counts["target"]
    return {
        "rows": rows[:_MOST_OTHERS],
        "left_out": max(len(rows) - _MOST_OTHERS, 0),
        "placement": listed(f"{counts[kind]} of {kind}s" for kind in ("frame", "target") if counts[kind]) if placed else "",
    }


def _method(verdict, tested, known, descriptions, replicates):
    other = descriptions["held_out"]
    return {
        "tested": grouped(tested),
        "listed": grouped(known),
        "replicates": grouped(replicates),
        "level": f"{100 * FAMILY_WISE_LEVEL:g} %",
        "held_out": counted(verdict["heldout"]["poses"], "pose"),
        "where": f" of another campaign ({other['campaign']['campaign']})" if other else "",
        "declared": listed(map(words, descriptions["campaign"]["declared"])) if descriptions["campaign"]["declared"] else "",
        "identified": descriptions["campaign"]["compliance"] == "identify",
    }


def _sentence(text):
    text = text.strip()
    return _capital(text) + ("" if text.endswith(".") else ".")


def _capital(text):
    return text[:1].upper() + text[1:]


def _minus(text):
    return text.replace("-", "−")
