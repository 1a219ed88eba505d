"""What a certificate states, worded, from its contents."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from elastocal.application.accuracy import MEASURED, PREDICTED, accuracy_from, accuracy_sentence, millimetres
from elastocal.application.certificate import ISO_CYCLES, ISO_POSES
from elastocal.counting import counted
from elastocal.diagnosis.words import listed, physical_name
from elastocal.report.first_page import TITLES, whose_errors
from elastocal.report.wording import MICRO, capital, length, minus, percent, plain, span_words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

_SHARES = {
    "joint_compliance": "joint compliance under loads and weights",
    "declared_weight": "errors of the declared weights",
    "joint_offset": "joint offsets",
    "link_geometry": "link geometry",
    "uncorrected": "no correction at all",
    "form of the model": "form of the model",
    "not commanded": "effects that no command contains",
}
_STEPS = {
    "uncorrected": "uncorrected: the robot file, its base placed as well as possible",
    "declared": "declared model, fitted",
    "corrected": "with the effects found",
}
# From here on the tracker's noise hides the robot's own repeatability.
_HIDDEN = 0.8
_SHOWN_CHANGES = 12
# Below the digits of any tracker.
_NOTHING_M = 1e-7
# Below this probability of the observed change where nothing changed, a robot counts as changed.
_LEVEL = 0.05


def share_name(name: str) -> str:
    """A line of the error budget in words."""
    return _SHARES.get(name) or physical_name(name)


def certificate_facts(document: Mapping[str, Any]) -> dict[str, Any]:
    """Facts for the pages of a certificate.

    `document`: of `loop.certificate.certificate`. Returns JSON-serialisable; strings ready to print, lists for tables.
    """
    conformity, steps, stated = document["conformity"], document["held_out"], document["stated"]
    return {
        "campaign": document["campaign"],
        "robot": document["robot"],
        # What is not stated is filled in by hand.
        "identity": [
            ["certificate number", stated.get("number", "")],
            ["robot", document["robot"]],
            ["serial number", document["serial"]],
            ["campaign", document["campaign"]],
            ["measured on", stated.get("measured_on", "")],
            ["instrument", stated.get("instrument", "")],
            ["calibration of the instrument", stated.get("instrument_calibration", "")],
            ["temperature", stated.get("temperature", "")],
            ["operator", stated.get("operator", "")],
            ["date of this certificate", document["date"]],
            ["signature", ""],
        ],
        "headline": headline(document),
        "made": [
            ["fitted poses span", span_words(document["joint_ranges"])],
            ["software", ", ".join(f"{name} {version}" for name, version in document["versions"].items())],
            ["commit of the diagnosis", document["origin"]["commit"]],
        ],
        "decision": conformity["decision"],
        "decision_sentences": decision_sentences(document),
        "verdict": verdict_sentence(document),
        "accuracy": before_and_after(document),
        "now": what_to_do(document),
        "steps": [
            [
                _STEPS[step["model"]]
                if step["model"] != "corrected"
                else f"with {physical_name(step['step'].removeprefix('with '))}",
                *(_with_interval(step, metric) for metric in ("mean_m", "rms_m", "p95_m", "max_m")),
            ]
            for step in steps
        ],
        "whose": whose_errors(steps[-1]["rms_m"], accuracy_from(document["predicted"])),
        "floor": length(document["noise_floor_rms_m"]),
        "iso": iso_rows(document["iso_9283"], document["measured"]),
        "iso_warning": iso_warning(document["iso_9283"]["repeatability"]),
        "budget": [[share_name(line["name"]), _share(line), _limits(line)] for line in document["budget"]],
        "budget_states": counted(document["budget_states"], "state"),
        "workspace": workspace_rows(document["workspace"]),
        "point": document["point"],
        "misplaced": [each["sentence"] for each in document["misplaced"]],
        "files": [
            ["code of the diagnosis", document["origin"]["code_sha256"]],
            ["data of the diagnosis", document["origin"]["data_sha256"]],
            *([name, digest] for name, digest in (document["files"] | document["measured_files"]).items()),
        ],
    }


def headline(document: Mapping[str, Any]) -> dict[str, str]:
    """What is decided, by which criterion: ``title``, and the errors in mm: ``rms``, ``limit``, ``worst``, ``tolerance``."""
    found, accuracy = document["conformity"], accuracy_from(document["accuracy"])
    kind = accuracy.kind
    return {
        "title": f"{capital(found['decision'])}, as {kind}",
        "rms": millimetres(accuracy.rms_m),
        "limit": millimetres(found["limit_m"]),
        "tolerance": millimetres(found["tolerance_m"]),
        "sure": _percent(1.0 - found["accepted_risk"]),
        "kind": kind,
        "worst": millimetres(accuracy.worst_m),
        "worst_pose": _pose_words(document["worst_pose"]["joints"]) if kind == PREDICTED else "",
    }


def _pose_words(joints: Sequence[Mapping[str, Any]]) -> str:
    """A command joint by joint, in degrees and mm."""
    return minus(
        ", ".join(
            f"{1e3 * joint['value']:.1f} mm" if joint["unit"] == "m" else f"{math.degrees(joint['value']):.1f}°"
            for joint in joints
        )
    )


def decision_sentences(document: Mapping[str, Any]) -> str:
    """What is compared with the tolerance, whose error that is, how sure."""
    found, accuracy = document["conformity"], accuracy_from(document["accuracy"])
    tolerance, sure = millimetres(found["tolerance_m"]), _percent(1.0 - found["accepted_risk"])
    criterion = (
        f"Criterion: the {accuracy.kind} RMS position error of the corrected robot, {sure} sure to be below "
        f"{millimetres(found['limit_m'])}, against the tolerance of {tolerance}."
    )
    risk = f"The risk that the RMS error is larger than the tolerance is {_percent(found['risk_above'])}"
    accepted = _percent(found["accepted_risk"])
    missing = found["shortfalls"]
    text = {
        "pass": f"{risk}; {accepted} are accepted.",
        "fail": f"{risk}; to fail wrongly {accepted} are accepted.",
        "undecided": f"{risk}: too much to pass and too little to fail, with {accepted} accepted.",
    }[found["decision"]]
    if missing and found["risk_above"] <= found["accepted_risk"]:
        text = f"{risk}, but the poses say too little of the robot's use to pass: {'; '.join(missing)}."
    more = []
    if found["poses_needed"] is not None:
        more.append(f"About {counted(found['poses_needed'], 'measured pose')} would decide.")
    if found["poses_inside"] is not None:
        more.append(
            f"In {found['poses_inside']} of {found['poses']} poses every measurement stays within the tolerance, noise and "
            f"all, which shows this for {percent(found['share_inside'])} of all poses at 95 % confidence."
        )
    if accuracy.kind == PREDICTED:
        more.append("Nobody has measured the corrected robot: command corrected targets, measure, and give --measured.")
    return " ".join([criterion, text, accuracy_sentence(accuracy), *more])


def verdict_sentence(document: Mapping[str, Any]) -> str:
    """What the diagnosis found."""
    title = capital(TITLES[document["verdict"]])
    names = [physical_name(name) for name in document["effects"]]
    return f"{title}: {listed(names)}." if names else f"{title}."


def before_and_after(document: Mapping[str, Any]) -> str:
    """What correction is worth at the fitted poses: both as they are predicted, in one frame."""
    after = accuracy_from(document["predicted"])
    before = next(line["rms_m"] for line in document["budget"] if line["name"] == "uncorrected")
    return (
        f"At {after.region} the uncorrected robot is off by {millimetres(before)} RMS and the corrected one by "
        f"{millimetres(after.rms_m)}, both as predicted by the model that was found and in the same frame."
    )


def what_to_do(document: Mapping[str, Any]) -> str:
    """What follows for whoever runs the robot."""
    decision = document["conformity"]["decision"]
    first, last = document["held_out"][0], document["held_out"][-1]
    verb = "keeps" if document["accuracy"]["kind"] == MEASURED else "is predicted to keep"
    advice = {
        "pass": f"Use the robot with corrected targets (elastocal correct): it {verb} the tolerance.",
        "fail": "Correct the targets all the same, which lowers the error; for this tolerance the robot is not good enough, or "
        "too little is known of it: the error budget says which.",
        "undecided": "Use corrected targets, and measure the robot at them before the tolerance is relied upon.",
    }[decision]
    if last["rms_m"] >= first["rms_m"]:
        advice = "Do not correct the robot by this campaign: on validation poses it would be no better."
    return advice


def iso_rows(found: Mapping[str, Any], measured: Mapping[str, Any] | None) -> list[list[str]]:
    """Rows of the table after ISO 9283: quantity, value, how it was taken; pose accuracy only of a robot that was measured."""
    rows = []
    if measured is not None:
        poses = counted(measured["poses"], "corrected pose")
        rows += [
            ["pose accuracy AP, corrected, mean", length(measured["mean_m"]), poses],
            ["pose accuracy AP, corrected, largest", length(measured["largest_m"]), poses],
        ]
    repeats = found["repeatability"]
    if repeats is None:
        return [*rows, ["pose repeatability RP", "unknown", "no pose was approached again"]]
    low, high = (length(value) for value in repeats["position_interval_m"])
    taken = _taken(repeats)
    rows.append(["pose repeatability RP, position", f"{length(repeats['position_m'])} ({low} to {high})", taken])
    if repeats["orientation_rad"] is not None:
        rows.append(["pose repeatability RP, orientation", f"{plain(MICRO * repeats['orientation_rad'])} µrad", taken])
    sensor = found["repeatability_of_sensor_m"]
    hides = sensor > _HIDDEN * repeats["position_m"]
    worth = "so large that it hides the robot's own" if hides else "part of the values above"
    return [*rows, ["RP that the tracker's noise alone would give", length(sensor), worth]]


def iso_warning(repeats: Mapping[str, Any] | None) -> str:
    """What keeps repeats from being a test after ISO 9283; empty where they are enough."""
    if repeats is None:
        return "No pose was approached again, so that no repeatability can be stated."
    if repeats["poses"] >= ISO_POSES and repeats["approaches"] >= ISO_CYCLES * repeats["poses"]:
        return ""
    return f"{_taken(repeats)} are fewer than the standard asks for: the values are an indication and no test after ISO 9283."


def _taken(repeats: Mapping[str, Any]) -> str:
    return f"{counted(repeats['approaches'], 'approach', 'approaches')} to {counted(repeats['poses'], 'pose')}"


def workspace_rows(maps: list[Mapping[str, Any]]) -> list[list[str]]:
    """Rows of the table of the workspace: load, uncorrected, bound, bound inside the fitted range, share outside."""

    def quantiles(found: Mapping[str, float] | None) -> str:
        return "–" if found is None else f"{length(found['median_m'])} / {length(found['p95_m'])}"

    return [
        [
            f"{each['force_N']:.0f} N hanging" if each["force_N"] else "none",
            *(quantiles(each[name]) for name in ("uncorrected", "bound", "bound_inside")),
            percent(each["share_outside"]),
        ]
        for each in maps
    ]


def _with_interval(step: Mapping[str, Any], metric: str) -> str:
    low, high = step[f"{metric}_low"], step[f"{metric}_high"]
    value = length(step[metric])
    if low is None:
        return value
    return f"{value} ({length(low)} to {length(high)})" if high is not None else f"{value} (from {length(low)})"


def _limits(line: Mapping[str, Any]) -> str:
    known = line["low_m"] is not None and line["rms_m"] >= _NOTHING_M
    return f"{length(line['low_m'])} to {length(line['high_m'])}" if known else "–"


def _share(line: Mapping[str, Any]) -> str:
    if 0.0 < line["rms_m"] < _NOTHING_M:
        return f"below {length(_NOTHING_M, 1)}"
    hidden = line["name"] == "repeatability" and not line["rms_m"]
    return "hidden by the tracker's noise" if hidden else length(line["rms_m"])


def _percent(share: float) -> str:
    return "below 0.1 %" if share < 0.001 else f"{100 * share:.2g} %"
