"""The first page of a campaign's report: how good the robot is, what to do now, what is missing and how sure that is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.application.frames import BASE
from elastocal.counting import counted
from elastocal.data_checks.protocol import OF_DATA, data_at_fault
from elastocal.diagnosis.hypotheses import OTHER
from elastocal.diagnosis.words import (
    NOTHING,
    RELATED,
    UNKNOWN,
    alternative_words,
    effect_words,
    found_words,
    hypotheses_words,
    in_common,
    listed,
    physical_name,
)
from elastocal.effects.catalogue import effects
from elastocal.report.wording import (
    MICRO,
    MILLI,
    as_sentence,
    capital,
    length,
    millimetres,
    minus,
    percent,
    plain,
    probability_words,
    words,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from typing import Any

    from elastocal.application.accuracy import Accuracy

TITLES = {
    "adequate": "the declared model is adequate",
    "named": "one mechanism is missing in the declared model",
    "class": "one mechanism is missing in the declared model; which one is ambiguous",
    "several": "several mechanisms are missing in the declared model",
    "unexplained": "something is missing in the declared model that the catalogue does not have",
    "not_testable": "these measurements can test no mechanism",
}
AT_FAULT = "the data are at fault"
# Hypotheses below this stand together as "something else", and so do those beyond the first few.
LEAST_SHOWN, _MOST_SHOWN = 0.01, 4
# From this probability on a location is stated without its alternatives, and a cause is real.
_SURE = 0.95
# Causes of which page 1 has a bar, if they are not part of the verdict.
_MOST_CAUSES = 6
# A cause is negligible below this share of the corrected robot's error: squares add up, so that leaving it uncorrected raises
# the error by 5 % at most. Ellison, S. L. R. and Williams, A. (eds.), EURACHEM/CITAC Guide CG 4, 2012, section 7.2.2:
# components below a third of the largest need no closer look.
NEGLIGIBLE = 1 / 3
MOST_NAMES = 8
# The last digit of a cost.
_FINEST_M = 1e-6
_COST = "the RMS error at the poses and loads of the campaign if it alone is left uncorrected"


def headline(verdict: Mapping[str, Any]) -> dict[str, str] | None:
    """The errors on validation poses in mm: ``before`` any calibration, ``after``, and what ``noise`` alone leaves.

    None where the data are at fault; ``noise`` is empty where it is not known.
    """
    if data_at_fault(verdict):
        return None
    errors, floor = verdict["heldout"], verdict["heldout"]["noise_floor_rms_m"]
    return {
        "before": millimetres(errors["uncalibrated"]["rms_m"]),
        "after": millimetres(errors["after"]["rms_m"]),
        "noise": millimetres(floor) if floor else "",
        "poses": counted(errors["poses"], "validation pose"),
    }


def headline_sentence(stated: Mapping[str, str]) -> str:
    """A headline in one line: 1.18 → 0.110 mm (noise 0.105)."""
    noise = f" (noise {stated['noise']})" if stated["noise"] else ""
    return f"{stated['before']} → {stated['after']} mm{noise}, RMS position error on {stated['poses']}"


def whose_errors(measured_m: float, accuracy: Accuracy) -> str:
    """Whose error is measured on validation poses and whose is predicted, in which frames, and why both differ.

    `measured_m`: RMS error of the final model there, m.
    """
    frames = (
        ("the declared base's frame", "the same frame") if accuracy.frame == BASE else ("the tracker's frame", "its own frame")
    )
    parts = {
        "each pose's own error and the repeatability of the joints": accuracy.repeated_m,
        "effects that no command contains": accuracy.left_out_m,
        "the form of the model": accuracy.form_m,
    }
    rest = accuracy.rms_m**2 - sum(part**2 for part in parts.values())
    parts["the uncertainty of the parameters"] = float(np.sqrt(max(rest, 0.0)))
    return (
        f"{millimetres(measured_m)} mm at validation poses is the tracker against the model, its noise included, in "
        f"{frames[0]}; {millimetres(accuracy.rms_m)} mm is the robot alone, in {frames[1]}, mostly from "
        f"{max(parts, key=lambda name: parts[name])}."
    )


def cost_words(effect: Mapping[str, Any], heldout: Mapping[str, Any]) -> str:
    """What an effect costs at the campaign's poses and loads: the RMS error if it alone were left out of the correction."""
    cost = effect["cost_m"]
    if cost is None:
        module = effects().get(effect["name"])
        moves = module is None or module.moves_robot
        return "not in the final model" if moves else "an error of the measurement, not of the robot"
    if cost > NEGLIGIBLE * heldout["after"]["rms_m"]:
        return f"{millimetres(cost)} mm"
    # No finer than a micrometre, and what was found is not nothing.
    stated = millimetres(cost) if cost >= _FINEST_M / 2 else f"below {millimetres(_FINEST_M)}"
    return f"{stated} mm: {'real, ' if effect['probability'] >= _SURE else ''}negligible"


def cause_rows(verdict: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What may be missing, the most probable first: in words, with its probability and, of what was found, its cost.

    Mechanisms may act together, so that probabilities need not add up to one.
    """
    stated, found = verdict["probabilities"], {effect["name"]: effect for effect in verdict["effects"]}
    if stated is None:
        return []
    rows = [(_found(effect), effect["probability"], cost_words(effect, verdict["heldout"])) for effect in found.values()]
    others = [(_name_of(name, found), value, "") for name, value in stated["mechanisms"].items() if name not in found]
    others = [*others, (NOTHING, stated["nothing"], "")]
    others = sorted((row for row in others if row[1] >= LEAST_SHOWN), key=lambda row: -row[1])[:_MOST_CAUSES]
    return [
        {"name": capital(name), "probability": probability, "words": probability_words(probability), "cost": cost}
        for name, probability, cost in sorted([*rows, *others], key=lambda row: -row[1])
    ]


def _name_of(mechanism: str, found: Collection[str]) -> str:
    """A mechanism that was not found: beside one that was, what is unknown is a related one."""
    return (RELATED if found else UNKNOWN) if mechanism == OTHER else physical_name(mechanism)


def sentences(verdict: Mapping[str, Any]) -> list[str]:
    """The verdict in plain words.

    `verdict`: contents of verdict.json.
    """
    kind, found = verdict["verdict"], verdict["effects"]
    faults = [effect for effect in found if effect["family"] == OF_DATA]
    if faults:
        return [
            *(as_sentence(fault["detail"]) for fault in faults),
            "No mechanism was looked for, and the residuals below are those of the data as they are.",
        ]
    return [*(f"{capital(each['sentence'])}." for each in verdict["misplaced"]), *_of_mechanisms(verdict, kind, found)]


def _of_mechanisms(verdict: Mapping[str, Any], kind: str, found: Sequence[Mapping[str, Any]]) -> list[str]:
    tested = counted(verdict["candidates_tested"], "candidate cause")
    if kind == "not_testable":
        return [
            "Whatever a mechanism of the catalogue would contribute at a plausible size is lost in the noise, or the declared "
            "model absorbs it.",
            "So these measurements show neither that something is missing nor that nothing is.",
        ]
    share = 100 * verdict["probabilities"]["alarm_p_value"]
    chance = f"{share:.2g} %" if share < 99.5 else "100 %"
    level = f"the alarm is set to {percent(verdict['settings']['alarm_level']['value'])}"
    if kind == "adequate":
        return [
            f"The declared model explains these measurements: none of {tested} is needed. Where nothing is missing, {chance} "
            f"of such campaigns speak as much for a missing mechanism as this one; {level}."
        ]
    alarm = f"If nothing were missing, {chance} of such campaigns would speak as much for a missing mechanism; {level}."
    if verdict["contradictions"]:
        return [
            f"No mechanism of the catalogue is needed, and yet the declared model cannot be right: "
            f"{'; '.join(verdict['contradictions'])}.",
            alarm,
        ]
    if kind == "unexplained":
        return [
            "The residual of the declared model is more than noise, and a smooth error of unknown cause explains it better "
            f"than any of {tested}.",
            alarm,
        ]
    named = [_found(effect) for effect in found]
    if kind == "several":
        each = listed(
            f"{name} ({probability_words(effect['probability'])}; {cost_words(effect, verdict['heldout'])})"
            for name, effect in zip(named, found, strict=True)
        )
        first = f"The declared model lacks {counted(len(found), 'mechanism')}: {each}."
        return [
            first,
            f"In brackets: how probable it is; its cost, {_COST}.",
            *(_ambiguity(effect) for effect in found if effect["alternatives"]),
            alarm,
        ]
    (effect,) = found
    if kind == "class":
        parts = [f"The declared model lacks one mechanism, most probably {named[0]}.", _ambiguity(effect)]
    else:
        parts = [f"The declared model lacks one mechanism: {named[0]}.", *_unsure_location(effect)]
    if effect["cost_m"] is not None:
        parts.append(f"Its cost, {_COST}: {cost_words(effect, verdict['heldout'])}.")
    return [*parts, alarm]


def probability_sentence(probabilities: Mapping[str, Any]) -> str:
    """The most probable hypotheses in words, with their probabilities: 94 % gravity sag of joint 2, 6 % something else.

    `probabilities`: as in verdict.json.
    """
    shown = [entry for entry in probabilities["sets"] if entry["probability"] >= LEAST_SHOWN][:_MOST_SHOWN]
    named = zip(shown, hypotheses_words(shown), strict=True)
    parts = [f"{probability_words(entry['probability'])} {words}" for entry, words in named]
    rest = 1.0 - sum(entry["probability"] for entry in shown)
    if rest >= 0.005:
        parts.append(f"{probability_words(rest)} something else")
    return ", ".join(parts)


def what_to_do(verdict: Mapping[str, Any], experiment: Sequence[Mapping[str, Any]]) -> list[str]:
    """What follows from the verdict for whoever runs the robot, list of str."""
    kind, found, heldout = verdict["verdict"], verdict["effects"], verdict["heldout"]
    if data_at_fault(verdict):
        return ["Correct the data as stated, in the file or where they are exported, and diagnose again.", *_transforms(found)]
    if verdict["kept"] == "frames":
        return [
            "Leave the robot as its file has it: a calibration by these measurements predicts poses that were left out worse "
            "than none. Measure more poses all over the joint ranges, and diagnose again."
        ]
    if kind == "not_testable":
        return [
            "Measure more: more poses all over the joint ranges, repeats, loads if the robot carries any. The table of what "
            "could not be tested says what each mechanism needs."
        ]
    if kind == "adequate":
        error = length(heldout["after"]["rms_m"])
        return [
            f"Use the declared model with the parameters fitted here. {_off_by(error)}",
            "Effects too small for these measurements may still be there. More poses, larger loads or repeats would show them.",
        ]
    advice, adopted = [], any(effect["adopted"] for effect in found)
    if found and not adopted:
        error = length(heldout["after"]["rms_m"])
        advice.append(
            "Use the declared model until more is known: what was found is too uncertain to make predictions better and is not "
            f"part of the final model. {_off_by(error)}"
        )
    elif found:
        low, high = heldout["reduction_ci95"]
        if low > 0:
            advice.append(
                "Use the corrected model: on poses that it was not fitted to it is more accurate. The command elastocal "
                "correct corrects targets by it, elastocal export writes the calibrated robot."
            )
        elif high < 0:
            advice.append("Do not use the corrected model: on poses that it was not fitted to it is less accurate.")
        else:
            advice.append(
                "The gain on poses that the corrected model was not fitted to is not certain: measure more validation poses "
                "before it is used."
            )
    if kind == "unexplained":
        advice.append(
            "Check first what no model of the robot can describe: a loose target, a tracker or robot foot that moved, warming "
            "up, loads noted wrongly. Then measure again, with repeats, time and approach direction recorded."
        )
    elif experiment:
        poses = len({(row["effect"], row["pose"]) for row in experiment})
        advice.append(
            f"To resolve what is ambiguous measure the {counted(poses, 'pose')} of the next experiment, which the report lists."
        )
    elif kind == "class" and adopted:
        advice.append(
            "Until an experiment resolves which mechanism acts, trust the correction at poses and loads like these only."
        )
    if found and heldout["outside_range"]["poses"]:
        advice.append("Beyond the range of the fitted poses the errors are extrapolated, and may be larger.")
    return advice


def _off_by(error: str) -> str:
    return f"At validation poses it is off by {error} RMS from what the tracker measured, its noise included."


def held_out_sentence(verdict: Mapping[str, Any], steps: Sequence[Mapping[str, Any]]) -> str:
    held_out = verdict["heldout"]
    before, after = held_out["before"]["rms_m"], held_out["after"]["rms_m"]
    poses = counted(held_out["poses"], "pose")
    floor = held_out["noise_floor_rms_m"]
    noise = f" Noise alone leaves {length(floor)}." if floor else ""
    ends = [step for step in steps if step["kind"] != "frames"]
    if len(ends) < 2:
        error = _with_interval(after, ends[-1])
        worth = worth_sentence(held_out)
        return f"On {poses} that were not fitted the declared model leaves an RMS error of {error}. {worth}{noise}"
    named = [_with_interval(before, ends[0]), _with_interval(after, ends[-1])]
    change = _change(before, after, held_out["reduction_ci95"], named)
    return f"On {poses} that were not fitted the RMS error {change}. {worth_sentence(held_out)}{noise}"


def worth_sentence(held_out: Mapping[str, Any]) -> str:
    """What calibration is worth against doing nothing, on held-out poses; ``heldout`` of verdict.json."""
    nothing, after = held_out["uncalibrated"]["rms_m"], held_out["after"]["rms_m"]
    if np.isclose(nothing, after, rtol=1e-3, atol=0):
        return f"The robot is as good uncalibrated, at {length(after)} RMS with nothing but its placement fitted."
    change = _change(nothing, after, held_out["uncalibrated"]["reduction_ci95"], [length(nothing), length(after)])
    return f"Against the uncalibrated robot, with nothing but its placement fitted, it {change}."


def _change(before: float, after: float, interval: Sequence[float], named: Sequence[str]) -> str:
    fall = 100 * (1 - after / before)
    verb, by = ("falls", fall) if fall >= 0 else ("grows", -fall)
    low, high = (minus(f"{100 * value:.0f}") for value in interval)
    return f"{verb} from {named[0]} to {named[1]}, by {by:.0f} % (95 % interval of the reduction: {low} to {high} %)"


def _found(effect: Mapping[str, Any]) -> str:
    return found_words(effect["name"], effect["members"])


def _ambiguity(effect: Mapping[str, Any]) -> str:
    if not effect["alternatives"]:
        return f"Its probability is {probability_words(effect['probability'])}."
    others = listed((alternative_words(name) for name in effect["alternatives"]), MOST_NAMES, last="or")
    common = in_common(effect["name"], effect["alternatives"])
    either = f"; it is {common} either way" if common else ""
    return f"Instead of {physical_name(effect['name'])} it may be {others}: these measurements do not distinguish them{either}."


def _unsure_location(effect: Mapping[str, Any]) -> list[str]:
    found = [entry for entry in effect["locations"] if entry["probability"] >= LEAST_SHOWN]
    if len(effect["members"]) > 1 or not found or found[0]["probability"] >= _SURE:
        return []
    each = listed(
        (f"{location_words(effect['name'], entry['location'])} ({probability_words(entry['probability'])})" for entry in found),
        4,
    )
    return [f"Its location is less certain: {each}."]


def _transforms(faults: Sequence[Mapping[str, Any]]) -> list[str]:
    """What turns the data into data that fit, where a fault states it."""
    return [
        f"{capital(words(fault['name']))}: the data fit with "
        + listed(f"{entry['name']} = {minus(plain(entry['value'], 4))} {entry['unit']}" for entry in known)
        + "."
        for fault in faults
        if (known := [entry for entry in fault["parameters"] if entry["unit"] not in ("–", "1")])
    ]


def _with_interval(value: float, step: Mapping[str, Any]) -> str:
    """A length with its 95 % interval, in one unit."""
    low, high = step["heldout_rms_m_low"], step["heldout_rms_m_high"]
    if not np.isfinite([low, high]).all():
        return length(value)
    number, unit = length(value).split("\u00a0")
    factor = MICRO if unit == "µm" else MILLI
    return f"{number} [{plain(factor * low)}, {plain(factor * high)}]\u00a0{unit}"


def location_words(effect: str, location: str) -> str:
    """A location in words, without its effect: links 1, 2 and 3 (one section)."""
    return effect_words(effect, [location]).removeprefix(physical_name(effect)).strip().removeprefix("of ") or "the whole robot"
