"""Rows of the tables of a campaign's report."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import counted, grouped
from elastocal.effects.protocol import effect_of
from elastocal.report import words as say

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from typing import Any

METRICS = ("mean", "rms", "p95", "max")
_SPLITS = {"held out": "validation poses", "joint space": "block of joint space", "session": "session"}
# Where a standard error is above this share of the prior's, the measurements say hardly more than the prior.
MOSTLY_PRIOR = 0.7
# More than these would fill pages that nobody reads; the tables have them all.
_MOST_OTHERS, _MOST_BLOCKS = 40, 12
# Letters of a list of places beyond which only the first few are shown.
_LONGEST, _SHOWN = 100, 4


def _error_unit(lengths_m: Sequence[float]) -> tuple[float, str]:
    return (say.MILLI, "mm") if max(lengths_m) >= 1e-3 else (say.MICRO, "µm")


def _cell(row: Mapping[str, Any], name: str, factor: float, unit: str) -> list[str]:
    """A value and its interval, in lines."""
    value, low, high = (factor * row[name + end] for end in ("", "_low", "_high"))
    number, *ends = (
        f"{each:.3f}" if unit == "mm" else say.minus(f"{each:.0f}") if np.isfinite(each) else "" for each in (value, low, high)
    )
    if np.isnan(low) or np.isnan(high):
        return [number, "–"]
    return [number, f"≥ {ends[0]}" if np.isinf(high) else f"[{ends[0]}, {ends[1]}]"]


def step_rows(steps: Sequence[Mapping[str, Any]], floor_m: float | None) -> dict[str, Any]:
    """Rows of the table before and after; each error as a list of lines: value, interval, multiple of the noise floor."""
    factor, unit = _error_unit([step["heldout_max_m"] for step in steps])
    rows = []
    for step in steps:
        multiples = {name: [f"{step[f'heldout_{name}_over_floor']:.2f} × floor"] if floor_m else [] for name in METRICS}
        cells = [[*_cell(step, f"heldout_{name}_m", factor, unit), *multiples[name]] for name in METRICS]
        train = factor * step["train_rms_m"]
        row = {"name": say.in_words(step["step"]), "kind": step["kind"], "parameters": str(int(step["parameters"]))}
        rows.append(row | {"training": f"{train:.3f}" if unit == "mm" else f"{train:.0f}", "cells": cells})
    return {"unit": unit, "rows": rows}


def split_rows(splits: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Rows of the splits table: what was left out, poses, RMS error before and after, reduction; errors with intervals."""
    if not splits:
        return {"unit": "mm", "rows": [], "left_out": 0, "changed": False}
    factor, unit = _error_unit([row[f"{stage}_rms_m"] for row in splits for stage in ("before", "after")])
    changed = any(row["before_rms_m"] != row["after_rms_m"] for row in splits)
    counts = Counter(row["split"] for row in splits)
    shown = [row for row in splits if row["block"] == "all" or counts[row["split"]] <= _MOST_BLOCKS]
    rows = []
    for row in shown:
        together, name = row["block"] == "all", _SPLITS[row["split"]]
        what = name if row["split"] == "held out" else f"every {name} in turn" if together else f"{name} {row['block']}"
        cells = [_cell(row, f"{stage}_rms_m", factor, unit) for stage in ("before", "after")[: 1 + changed]]
        if changed:
            fall, interval = _cell(row, "reduction", 100, "%")
            cells.append([f"{fall} %", interval])
        rows.append({"name": what, "together": together, "poses": str(int(row["poses"])), "cells": cells})
    return {"unit": unit, "rows": rows, "left_out": len(splits) - len(shown), "changed": changed}


def as_judged(
    splits: Sequence[dict[str, Any]], steps: Sequence[Mapping[str, Any]], heldout: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Rows of the splits, that of the held-out poses with the intervals that stand in the table of the steps."""
    ends = [step for step in steps if step["kind"] != "frames"]
    stages = (("before", ends[0]), ("after", ends[-1]))
    judged = {f"{stage}_rms_m_{end}": step[f"heldout_rms_m_{end}"] for stage, step in stages for end in ("low", "high")}
    judged |= dict(zip(("reduction_low", "reduction_high"), heldout["reduction_ci95"], strict=True))
    return [row | judged if row["split"] == "held out" else row for row in splits]


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
        cells = [*(f"{np.degrees(row[name]):.1f}" for name in angles), *(f"{round(row[name])}" for name in loads)]
        shown.append([say.minus(cell) for cell in (*cells, say.plain(row["separation"]), say.percent(row["resolved"]))])
    heads = [*(f"{name} °" for name in angles), *(f"{name} {unit}" for name, unit in loads.items()), "separation", "resolved"]
    return {"loaded": bool(loads), "heads": heads, "rows": shown, "points": say.listed(rows[0]["point"].split())}


def measured_rows(table: Mapping[str, np.ndarray], descriptions: Mapping[str, Any]) -> list[list[str]]:
    """Rows of what was measured: name, at fitted poses, at validation poses."""
    held_out = table["held_out"].astype(bool)
    campaigns = [descriptions["campaign"], (descriptions["held_out"] or descriptions)["campaign"]]
    masks = zip((~held_out, held_out), campaigns, strict=True)
    parts = [_part({name: values[mask] for name, values in table.items()}, campaign) for mask, campaign in masks]
    return [[name, *(part[name] for part in parts)] for name in parts[0]]


def _part(part: Mapping[str, np.ndarray], campaign: Mapping[str, Any]) -> dict[str, str]:
    """What was measured in one part of the measurements."""
    if not len(part["pose"]):
        return dict.fromkeys(("campaign", "measurements"), "none")

    def distinct(*names: str) -> np.ndarray:
        """How often each combination of values of some columns occurs."""
        return np.unique(np.column_stack([part[name] for name in names]), axis=0, return_counts=True)[1]

    each, oriented = distinct("session", "pose", "load", "target"), campaign["measured"] == "pose"
    force = np.linalg.norm([part[name] for name in ("fx", "fy", "fz")], axis=0)
    loaded, loads = force[force > 0], "none"
    targets = list(campaign["targets"].items())
    if len(loaded):
        same = np.isclose(loaded.min(), loaded.max(), rtol=1e-3)
        ends = " to ".join(map(say.plain, [loaded.min()] if same else [loaded.min(), loaded.max()]))
        numbers = counted(len(np.unique(part["load"][force > 0])), "load")
        loads = f"{numbers} of {ends} N on {say.percent(len(loaded) / len(force))} of the measurements"
    used = [
        ("" if name == target["point"] else f"{name} ") + f"at the measuring point {target['point']}{_mount(target, oriented)}"
        for name, target in (targets[number] for number in np.unique(part["target"]))
    ]
    return {
        "campaign": campaign["campaign"],
        "measurements": f"{grouped(len(force))}, each a {'position and orientation' if oriented else 'position'}",
        "poses": f"{counted(len(distinct('session', 'pose')), 'pose')} in {counted(len(distinct('session')), 'session')}",
        "states (pose and load)": grouped(len(distinct("session", "pose", "load"))),
        "loads": loads,
        "targets": say.listed(used, 12),
        "repeats of a state": str(each.min())
        if each.min() == each.max()
        else f"{each.min()} to {each.max()}, median {np.median(each):g}",
        "coordinate frame": "the tracker's; its placement is fitted" if campaign["frame"] == "tracker" else "the base's",
        "time": "recorded" if np.isfinite(part["time_s"]).any() else "not recorded",
    }


def _mount(target: Mapping[str, Any], oriented: bool) -> str:
    """What is fitted of how a target sits, and a known turn of its mount."""
    rotation = target.get("rotation", target["offset_m"]) if oriented else ""
    fitted = [word for word, value in (("place", target["offset_m"]), ("rotation", rotation)) if value == "unknown"]
    known = "rotation" in target and oriented and rotation != "unknown" and any(rotation)
    turned = f", turned by {np.degrees(np.linalg.norm(rotation)):.4g}°" if known else ""
    return turned + (f", {' and '.join(fitted)} fitted" if fitted else "")


def compliance_rows(compliance: Mapping[str, Sequence[float]]) -> list[list[str]]:
    """Rows of the compliances: joint, before, after with its standard error; no number of one that is not identifiable."""
    rows, columns = [], zip(*(compliance[name] for name in ("before", "after", "std_error")), strict=True)
    identified = any(compliance["std_error"])
    for joint, (before, after, error) in enumerate(columns, 1):
        if identified and not error:
            rows.append([str(joint), *["not identifiable"] * 2])
            continue
        stated = say.pm(after, error) if error else f"{after:.4g}"
        decimals = len(stated.rpartition(".")[2]) if "." in stated else 0
        rows.append([str(joint), f"{before:.{decimals}f}" if error else f"{before:.4g}", stated])
    return rows


def other_parameters(verdict: Mapping[str, Any], parameters: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Estimates of the declared model beside the compliances, and how many there are of them, of frames and of targets.

    Returns ``rows`` of the table, how many more there are (``left_out``), and ``placement`` in words.
    """
    mine = {member for effect in verdict["effects"] for member in effect.get("members", [])}
    rows: list[list[str]] = []
    counts: Counter[str] = Counter()
    columns = (parameters[name] for name in ("owner", "parameter", "value", "std_error", "unit", "held", "prior_std"))
    for owner, name, value, error, unit, held, prior in zip(*columns, strict=True):
        if held or owner in mine or owner in ("fit", "joint_compliance") or error > MOSTLY_PRIOR * prior:
            continue
        kind = owner.split(" ")[0] if owner.startswith(("frame ", "target ")) else "declared"
        counts[kind] += 1
        if kind == "declared" or (kind == "target" and unit == "rad"):
            # Where a target sits matters to nobody; how it is mounted is what the campaign may have wrongly.
            rows.append(
                [
                    say.capital(say.candidate_words(owner)),
                    say.parameter_words(effect_of(owner), name),
                    *say.scaled(value, error, unit),
                ]
            )
    placed = [f"{counts[kind]} of {kind}s" for kind in ("frame", "target") if counts[kind]]
    return {
        "rows": rows[:_MOST_OTHERS],
        "left_out": max(len(rows) - _MOST_OTHERS, 0),
        "placement": say.listed(placed) if placed else "",
    }


def held_rows(held: Iterable[str]) -> list[list[str]]:
    """Parameters that the measurements do not determine, one row for each owner."""
    owners: dict[str, list[str]] = {}
    for owner, _, parameter in (name.rpartition(" ") for name in held):
        owners.setdefault(owner, []).append(say.parameter_words(effect_of(owner), parameter))
    return [[say.capital(say.candidate_words(owner)), ", ".join(names)] for owner, names in owners.items()]


def left_to_priors(parameters: Mapping[str, np.ndarray]) -> list[str]:
    """Parameters about which the measurements say hardly more than their priors: owner and name, as in ``held``."""
    mine = (parameters["std_error"] > MOSTLY_PRIOR * parameters["prior_std"]) & ~parameters["held"].astype(bool)
    return [f"{owner} {name}" for owner, name in zip(parameters["owner"][mine], parameters["parameter"][mine], strict=True)]


def untestable_rows(untestable: Mapping[str, str]) -> list[list[str]]:
    """Candidates that were not tested, by their reasons, one row for each effect and reason."""
    found: dict[tuple[str, str], list[str]] = {}
    for key, reason in untestable.items():
        found.setdefault((effect_of(key), reason.replace("no approach", "no direction of approach")), []).append(key)
    rows = []
    for (effect, reason), keys in found.items():
        where = say.place_words(keys)
        if len(where) > _LONGEST:
            where = f"{say.place_words(keys[:_SHOWN])} and {len(keys) - _SHOWN} more"
        rows.append([say.capital(say.physical_name(effect)), where or "–", reason])
    return sorted(rows, key=lambda row: (row[2], row[0]))
