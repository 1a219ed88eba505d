"""Everything that the report of a campaign states, worded, from the files that the loop wrote."""

import re
from collections import Counter

import numpy as np

from elastocal.diagnosis.words import (
    alternative_words,
    candidate_words,
    in_words,
    listed,
    physical_name,
)
from elastocal.effects.catalogue import effects
from elastocal.effects.protocol import effect_of
from elastocal.report.first_page import (
    AT_FAULT,
    LEAST_SHOWN,
    MOST_NAMES,
    OF_DATA,
    TITLES,
    held_out_sentence,
    location_words,
    probability_sentence,
    sentences,
    what_to_do,
)
from elastocal.report.wording import (
    MICRO,
    MILLI,
    as_sentence,
    capital,
    counted,
    grouped,
    length,
    members_words,
    minus,
    percent,
    plain,
    probability_words,
    scaled,
    words,
)

METRICS = ("mean", "rms", "p95", "max")
NOISE_SOURCES = {
    "repeats": "The noise is taken from the differences between repeats of the same state.",
    "declared": "The noise is taken as the campaign declares it; there are too few repeats to check it.",
    "residual": "The noise is not known: with neither repeats nor a declared noise the residual itself was taken for it.",
}
NONE_FOUND = {
    "adequate": "No mechanism of the catalogue is needed to explain these measurements.",
    "unexplained": "No mechanism of the catalogue explains these measurements.",
    "not_testable": "No mechanism of the catalogue could be tested.",
}
SPLITS = {"held out": "validation poses (held out)", "joint space": "block of joint space", "session": "session"}
# A standard error above this share of the prior's says what the prior says.
_OF_THE_PRIOR = 0.7
# More than these would fill pages that nobody reads; the tables have them all.
_MOST_PARAMETERS, _SHOWN_PARAMETERS = 16, 10
_MOST_OTHERS, _MOST_BLOCKS = 40, 12


def loop_facts(verdict, steps, splits, experiment, table, descriptions, parameters):
    """Facts for the report of a campaign.

    Parameters
    ----------
    verdict : dict
        Contents of verdict.json.
    steps, splits, experiment : list of dict
        Rows of before_after.csv, splits.csv and next_experiment.csv.
    table, parameters : dict of str to ndarray
        Columns of the residuals and of the parameters of the final model.
    descriptions : dict
        Contents of campaign.json.

    Returns
    -------
    dict
        JSON-serialisable; strings ready to print, lists for tables.
    """
    faulty = any(effect["family"] == OF_DATA for effect in verdict["effects"])
    floor = verdict["heldout"]["noise_floor_rms_m"]
    return {
        "campaign": verdict["campaign"],
        "robot": descriptions["robot"]["name"],
        "verdict": AT_FAULT if faulty else TITLES[verdict["verdict"]],
        "faulty": faulty,
        "sentences": sentences(verdict),
        "probabilities": "" if faulty else probability_sentence(verdict["probabilities"]),
        "now": what_to_do(verdict, experiment),
        "warnings": [] if faulty else [as_sentence(in_words(warning)) for warning in verdict["warnings"]],
        "held_out_sentence": "" if faulty else held_out_sentence(verdict, steps),
        "measured": measured(table, descriptions),
        "noise": noise_rows(verdict["noise"], descriptions["campaign"]["measured"] == "pose"),
        "noise_source": NOISE_SOURCES[verdict["noise"]["source"]],
        "misfit": _misfit_sentence(verdict["misfit"]),
        "floor": length(floor),
        "steps": step_rows(steps, floor),
        "splits": split_rows(_as_judged(splits, steps, verdict["heldout"])),
        "range": range_sentence(verdict["heldout"]),
        "effects": [effect_facts(effect) for effect in verdict["effects"]],
        "none_found": NONE_FOUND.get(verdict["verdict"], NONE_FOUND["adequate"]),
        "experiment": experiment_facts(experiment, verdict.get("next_experiment")),
        "compliances": compliance_rows(verdict["compliance_urad_per_Nm"]),
        "compliances_identified": any(verdict["compliance_urad_per_Nm"]["std_error"]),
        "held": held_rows([*verdict["held"], *left_to_priors(parameters)]),
        "untestable": untestable_rows(verdict["untestable"]),
        "others": _other_parameters(verdict, parameters),
        "method": _method(verdict, descriptions),
        "settings": setting_rows(verdict["settings"]),
        "found": [effect["name"] for effect in verdict["effects"]],
    }


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
    rows.append(["error of every joint common to all measurements of a pose", f"{plain(MICRO * noise['pose_rad'])} µrad"])
    rows.append(["noise that the final model leaves, over the noise above", plain(noise["factor"])])
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
        name, number = in_words(step["step"]), str(int(step["parameters"]))
        rows.append(
            {"name": name, "kind": step["kind"], "parameters": number, "training": digits(step["train_rms_m"]), "cells": cells}
        )
    return {"unit": unit, "rows": rows}


def split_rows(splits):
    """Rows of the splits table: what was left out, poses, RMS error before and after, reduction; errors with intervals."""
    if not splits:
        return {"unit": "mm", "rows": [], "left_out": 0, "changed": False}
    factor, unit = _error_unit([row["before_rms_m"] for row in splits] + [row["after_rms_m"] for row in splits])
    rows, left_out = [], 0
    changed = any(row["before_rms_m"] != row["after_rms_m"] for row in splits)
    counts = Counter(row["split"] for row in splits)
    for row in splits:
        together = row["block"] == "all"
        name = SPLITS[row["split"]]
        if not together and counts[row["split"]] > _MOST_BLOCKS:
            left_out += 1
            continue
        what = name if row["split"] == "held out" else f"every {name} in turn" if together else f"{name} {row['block']}"
        errors = [
            [_number(factor * row[f"{stage}_rms_m"], unit), _interval(row, f"{stage}_rms_m", factor, unit)]
            for stage in ("before", "after")
        ]
        fall = [f"{_number(100 * row['reduction'], '%')} %", _interval(row, "reduction", 100, "%")]
        rows.append(
            {
                "name": what,
                "together": together,
                "poses": str(int(row["poses"])),
                "cells": [*errors, fall] if changed else errors[:1],
            }
        )
    return {"unit": unit, "rows": rows, "left_out": left_out, "changed": changed}


def _as_judged(splits, steps, heldout):
    """Rows of the splits, that of the held-out poses with the intervals that stand in the table of the steps."""
    ends = [step for step in steps if step["kind"] in ("declared", "effect")]
    judged = {
        f"{stage}_rms_m_{end}": step[f"heldout_rms_m_{end}"]
        for stage, step in (("before", ends[0]), ("after", ends[-1]))
        for end in ("low", "high")
    }
    judged |= dict(zip(("reduction_low", "reduction_high"), heldout["reduction_ci95"], strict=True))
    return [row | judged if row["split"] == "held out" else row for row in splits]


def range_sentence(heldout):
    """How many validation poses lie outside the range of the fitted ones, and what the errors are inside and outside."""
    by_range, poses = heldout["outside_range"], counted(heldout["poses"], "validation pose")
    share = (
        f"With 95 % confidence at least {percent(heldout['share_below_max'])} of all poses drawn like the validation poses "
        "have smaller errors than the largest found."
    )
    count = by_range["poses"]
    if not count:
        return f"All {poses} lie within the range of the fitted poses. {share}"
    ends = [(where, by_range[key]) for where, key in (("within", "inside"), ("outside", "outside")) if by_range[key]]
    each = []
    for where, errors in ends:
        stages = (length(errors[stage]["rms_m"]) for stage in ("before", "after"))
        each.append(f"{_before_and_after(*stages)} {where}")
    return (
        f"{count} of {poses} {'lies' if count == 1 else 'lie'} outside the range of the fitted poses: errors there are "
        f"extrapolated. The RMS error is {listed(each)} that range. {share}"
    )


def _before_and_after(before, after):
    return after if before == after else f"{before} before and {after} after"


def effect_facts(effect):
    """What the report says of one effect or fault of the data."""
    known = [entry for entry in effect["parameters"] if not entry.get("held")]
    rest = ""
    shown = known
    if len(known) > _MOST_PARAMETERS:
        shown = sorted(known, key=_distance_from_zero, reverse=True)[:_SHOWN_PARAMETERS]
        rest = (
            f"The {len(shown)} of {grouped(len(known))} parameters that lie farthest from zero, in standard errors; "
            "steps.parquet has them all."
        )
    members = effect["members"]
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
        "parameters": [_parameter_row(entry, members) for entry in shown],
        "with_prior": any(entry.get("prior_std") for entry in shown),
        "rest": rest,
        "held": f"{counted(held, 'of its parameters', 'of its parameters')} cannot be identified from these measurements."
        if held
        else "",
        "probability": "" if effect["probability"] is None else probability_words(effect["probability"]),
        "gain": "" if gain is None else _gain(gain),
        "adopted": effect["adopted"],
        "alternatives": listed(
            effect["alternatives"] if of_data else map(alternative_words, effect["alternatives"]), MOST_NAMES
        )
        if effect["alternatives"]
        else "",
        "evidence": _evidence(effect.get("evidence")),
    }


def description(effect):
    """What an effect of the catalogue is, in the words of its module, without the formula."""
    module = effects().get(effect)
    summary = module.__doc__.split("\n\n")[0].replace("\n", " ") if module else words(effect)
    return re.sub(r", \w+\([^,]*=.*$", "", summary.split(":")[0]).rstrip(".")


def experiment_facts(rows, said=None):
    """Table of the states proposed, angles in degrees, and what is said of them.

    Parameters
    ----------
    rows : list of dict
        Of next_experiment.csv.
    said : dict, optional
        Of verdict.json: ``sentence``, or the ``reason`` why nothing is proposed.

    Returns
    -------
    dict
    """
    said = said or {}
    sentence = said.get("sentence") or (f"No further measurement is proposed: {said['reason']}." if said.get("reason") else "")
    found = {"sentence": in_words(sentence), "loaded": False, "approach": False, "heads": [], "rows": [], "gains": []}
    if not rows:
        return found
    angles = [name for name in rows[0] if re.fullmatch(r"q\d+", name)]
    loads = {"fx": "N", "fy": "N", "fz": "N", "mx": "N·m", "my": "N·m", "mz": "N·m"}
    # Nothing is said of loads where all states are unloaded.
    loads = loads if any(row[name] for row in rows for name in loads) else {}
    sides = [name for name in rows[0] if re.fullmatch(r"approach\d+", name)]
    weighed = any(row.get("reference_weight_kg") for row in rows)
    heads = ["point", *(f"{name} °" for name in angles), *(f"{name} {unit}" for name, unit in loads.items())]
    heads += [*(["approach"] if sides else []), *(["weight kg"] if weighed else []), "separation"]
    several = len({row["effect"] for row in rows}) > 1
    shown, gains = [], []
    for row in rows:
        cells = [row["point"], *(f"{np.degrees(row[name]):.1f}" for name in angles)]
        cells += [f"{round(row[name])}" for name in loads]
        cells += ["".join("-0+"[int(np.sign(row[name])) + 1] for name in sides)] if sides else []
        cells += [plain(row["reference_weight_kg"])] if weighed else []
        cells.append(plain(row["separation"]))
        name = in_words(row["effect"])
        shown.append(([name] if several else []) + [minus(cell) for cell in cells])
        last = (name, plain(row["separation_without"]), plain(row["separation"]))
        gains = [gain for gain in gains if gain[0] != last[0]] + [last]
    heads = (["effect"] if several else []) + heads
    return found | {
        "loaded": bool(loads),
        "approach": bool(sides),
        "heads": heads,
        "rows": shown,
        "gains": [list(gain) for gain in gains],
    }


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


def left_to_priors(parameters):
    """Parameters about which the measurements say hardly more than their priors.

    Parameters
    ----------
    parameters : dict of str to ndarray
        Of the final model.

    Returns
    -------
    list of str
        Owner and name, as in ``held`` of verdict.json.
    """
    mine = _mostly_prior(parameters["std_error"], parameters["prior_std"]) & ~parameters["held"].astype(bool)
    return [f"{owner} {name}" for owner, name in zip(parameters["owner"][mine], parameters["parameter"][mine], strict=True)]


def _mostly_prior(std_error, prior_std):
    return std_error > _OF_THE_PRIOR * prior_std


def held_rows(held):
    """Parameters that the measurements do not determine, one row for each owner."""
    owners = {}
    for name in held:
        owner, parameter = name.rsplit(" ", 1)
        owners.setdefault(owner, []).append(words(parameter))
    return [[capital(candidate_words(owner)), ", ".join(names)] for owner, names in owners.items()]


def untestable_rows(untestable):
    """Candidates that were not tested, one row for each effect and reason.

    Parameters
    ----------
    untestable : dict of str to str
        Reason by candidate.

    Returns
    -------
    list of list of str
    """
    found = {}
    for key, reason in untestable.items():
        # Reasons that differ from joint to joint are one reason.
        alike = re.sub(r"^\d+ angles of joint \d+ where \d+ are needed$", "too few different joint angles", reason)
        alike = alike.replace("no approach", "no direction of approach")
        found.setdefault((re.split(r"[@\[]", key)[0], alike), []).append(key)
    rows = [[capital(physical_name(effect)), members_words(keys, 4) or "–", reason] for (effect, reason), keys in found.items()]
    return sorted(rows, key=lambda row: (row[2], row[0]))


def setting_rows(settings):
    """Rows of the settings: name, value, reason."""
    rows = []
    for name, entry in settings.items():
        values = entry["value"] if isinstance(entry["value"], (list, tuple)) else [entry["value"]]
        rows.append([words(name), ", ".join(f"{value:g}" for value in values), as_sentence(entry["reason"])])
    return rows


def _part(part, campaign):
    """What was measured in one part of the readings."""
    if not len(part["pose"]):
        return dict.fromkeys(("campaign", "measurements"), "none")
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
        loads = f"{numbers} of {' to '.join(ends)} N on {percent(len(loaded) / len(force))} of the measurements"
    return {
        "campaign": campaign["campaign"],
        "measurements": f"{grouped(len(part['pose']))}, each a {kind}",
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
        "coordinate frame": frame,
        "time": "recorded" if np.isfinite(part["time_s"]).any() else "not recorded",
    }


def _distinct(part, *names):
    return len(np.unique(np.column_stack([part[name] for name in names]), axis=0))


def _evidence(evidence):
    """RMS distance between measured and predicted positions as written and with the fault corrected."""
    if not evidence or None in evidence or len(evidence) < 2:
        return ""
    before, after = evidence[:2]
    return f"As written the data lie {length(before)} RMS from the nominal robot, corrected {length(after)}."


def _misfit_sentence(misfit):
    if not misfit:
        return ""
    before, after = plain(misfit["before"]), plain(misfit["after"])
    if before == after:
        return f"On the fitted poses the declared model leaves a mean square of {before} times that of the noise."
    return (
        f"On the fitted poses the declared model leaves a mean square of {before} times that of the noise, the most probable "
        f"model {after} times."
    )


def _of_data_joints(effect):
    joints = effect["joints"] if effect["family"] == OF_DATA else ()
    return f" of joint{'s' if len(joints) > 1 else ''} {listed(map(str, joints))}" if joints else ""


def _gain(gain):
    return f"lowers the held-out RMS by {100 * gain:.0f} %" if gain >= 0 else f"raises the held-out RMS by {-100 * gain:.0f} %"


def _parameter_row(entry, members):
    # The longest, since keys may have blanks and one may begin another.
    member = max((key for key in members if entry["name"].startswith(f"{key} ")), key=len, default=None)
    # What belongs to an effect as a whole, such as its largest sag, is no member's; faults of the data have none.
    owner = member or (effect_of(members[0]) if members else "")
    name = words(entry["name"].removeprefix(f"{owner} "))
    where = f"{members_words([member])}: " if member and len(members) > 1 else ""
    row = [where + name, *scaled(entry["value"], entry["std_error"], entry["unit"])]
    if entry["unit"] == "–" and float(entry["value"]).is_integer():
        row[1] = grouped(int(entry["value"]))
    prior = entry.get("prior_std")
    if prior and _mostly_prior(entry["std_error"], prior):
        return [*row, "mostly the prior"]
    return [*row, "measurements" if entry["std_error"] else ""]


def _distance_from_zero(entry):
    return abs(entry["value"]) / entry["std_error"] if entry["std_error"] else 0.0


def _error_unit(lengths_m):
    return (MILLI, "mm") if max(lengths_m) >= 1e-3 else (MICRO, "µm")


def _number(value, unit):
    return f"{value:.3f}" if unit == "mm" else minus(f"{value:.0f}")


def _interval(row, name, factor, unit):
    low, high = (factor * row[f"{name}_{end}"] for end in ("low", "high"))
    if np.isnan(low) or np.isnan(high):
        return "–"
    return f"≥ {_number(low, unit)}" if np.isinf(high) else f"[{_number(low, unit)}, {_number(high, unit)}]"


def _other_parameters(verdict, parameters):
    """Estimates of the declared model beside the compliances, and how many there are of them, of frames and of targets."""
    mine = {member for effect in verdict["effects"] for member in effect.get("members", [])}
    rows, counts = [], Counter()
    columns = (parameters[name] for name in ("owner", "parameter", "value", "std_error", "unit", "held", "prior_std"))
    for owner, name, value, error, unit, held, prior in zip(*columns, strict=True):
        if held or owner in mine or owner in ("fit", "joint_compliance") or _mostly_prior(error, prior):
            continue
        kind = owner.split(" ")[0] if owner.startswith(("frame ", "target ")) else "declared"
        counts[kind] += 1
        if kind == "declared":
            rows.append([capital(candidate_words(owner)), words(name), *scaled(value, error, unit)])
    placed = counts["frame"] + counts["target"]
    return {
        "rows": rows[:_MOST_OTHERS],
        "left_out": max(len(rows) - _MOST_OTHERS, 0),
        "placement": listed(f"{counts[kind]} of {kind}s" for kind in ("frame", "target") if counts[kind]) if placed else "",
    }


def _method(verdict, descriptions):
    other, settings = descriptions["held_out"], verdict["settings"]
    declared = descriptions["campaign"]["declared"]
    return {
        "tested": grouped(verdict["candidates_tested"]),
        "listed": grouped(verdict["candidates_tested"] + len(verdict["untestable"])),
        "draws": grouped(settings["alarm_draws"]["value"]),
        "level": percent(settings["alarm_level"]["value"]),
        "prior": percent(settings["mechanism_probability"]["value"]),
        "named": percent(settings["named_probability"]["value"]),
        "held_out": counted(verdict["heldout"]["poses"], "pose"),
        "where": f" of another campaign ({other['campaign']['campaign']})" if other else "",
        "declared": listed(map(physical_name, declared)) if declared else "",
        "identified": descriptions["campaign"]["compliance"] == "identify",
    }
