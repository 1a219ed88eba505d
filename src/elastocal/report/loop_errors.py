"""Errors of a campaign's models on held-out poses, as tables and sentences of its report: by step, by split, by range."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from elastocal.counting import counted
from elastocal.diagnosis.words import in_words, listed
from elastocal.report.wording import MICRO, MILLI, length, minus, percent, span_words

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

METRICS = ("mean", "rms", "p95", "max")
SPLITS = {"held out": "validation poses", "joint space": "block of joint space", "session": "session"}
# More rows than these would fill pages that nobody reads; the table has them all.
_MOST_BLOCKS = 12


def step_rows(steps: Sequence[Mapping[str, Any]], floor_m: float | None) -> dict[str, Any]:
    """Rows of the table before and after; each error as a list of lines: value, interval, multiple of the noise floor."""
    factor, unit = _error_unit([step["heldout_max_m"] for step in steps])
    rows = []
    for step in steps:
        cells = []
        for metric in METRICS:
            multiple = [f"{step[f'heldout_{metric}_over_floor']:.2f} × floor"] if floor_m else []
            error = _number(factor * step[f"heldout_{metric}_m"], unit)
            cells.append([error, _interval(step, f"heldout_{metric}_m", factor, unit), *multiple])
        row = {"name": in_words(step["step"]), "kind": step["kind"], "parameters": str(int(step["parameters"]))}
        rows.append(row | {"training": _number(factor * step["train_rms_m"], unit), "cells": cells})
    return {"unit": unit, "rows": rows}


def split_rows(splits: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
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
        cells = [*errors, fall] if changed else errors[:1]
        rows.append({"name": what, "together": together, "poses": str(int(row["poses"])), "cells": cells})
    return {"unit": unit, "rows": rows, "left_out": left_out, "changed": changed}


def as_judged(
    splits: Sequence[dict[str, Any]], steps: Sequence[Mapping[str, Any]], heldout: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Rows of the splits, that of the held-out poses with the intervals that stand in the table of the steps.

    `splits`, `steps`: rows of splits.csv and before_after.csv. `heldout`: of verdict.json.
    """
    ends = [step for step in steps if step["kind"] != "frames"]
    judged = {
        f"{stage}_rms_m_{end}": step[f"heldout_rms_m_{end}"]
        for stage, step in (("before", ends[0]), ("after", ends[-1]))
        for end in ("low", "high")
    }
    judged |= dict(zip(("reduction_low", "reduction_high"), heldout["reduction_ci95"], strict=True))
    return [row | judged if row["split"] == "held out" else row for row in splits]


def range_sentence(heldout: Mapping[str, Any]) -> str:
    """How many validation poses lie outside the range of the fitted ones, and what the errors are inside and outside."""
    by_range, poses = heldout["outside_range"], counted(heldout["poses"], "validation pose")
    share = (
        f"With 95 % confidence at least {percent(heldout['share_below_max'])} of all poses drawn like the validation poses "
        "have smaller errors than the largest found."
    )
    span = f"They are of {counted(heldout['configurations'], 'configuration')}: {span_words(heldout['joint_ranges'])}."
    count = by_range["poses"]
    if not count:
        return f"All {poses} lie within the range of the fitted poses. {span} {share}"
    ends = [(where, by_range[key]) for where, key in (("within", "inside"), ("outside", "outside")) if by_range[key]]
    each = []
    for where, errors in ends:
        stages = (length(errors[stage]["rms_m"]) for stage in ("before", "after"))
        each.append(f"{_before_and_after(*stages)} {where}")
    return (
        f"{count} of {poses} {'lies' if count == 1 else 'lie'} outside the range of the fitted poses: errors there are "
        f"extrapolated. The RMS error is {listed(each)} that range. {span} {share}"
    )


def remainder_sentence(remainder: Mapping[str, Any] | None, heldout: Mapping[str, Any]) -> str:
    """What a regression on the remainder adds on validation poses, and how far its intervals are to be believed."""
    if remainder is None:
        return ""
    if not remainder["regression"]:
        return (
            "No regression on what the final model leaves is used: none predicts fitted poses that it has not seen better "
            "than the model alone beyond chance."
        )
    low, high = (length(end) for end in remainder["rms_ci95_m"])
    fall = [minus(f"{-100 * end:+.0f}") for end in reversed(remainder["reduction_ci95"])]
    shares = {name: minus(f"{100 * remainder[name]:.1f} %") for name in ("physics", "regression_share", "left")}
    sentence = (
        f"A {remainder['words']}, fitted to what the final model leaves of the fitted poses, predicts the validation poses "
        f"with an RMS error of {length(remainder['errors']['rms_m'])} (95 %: {low} to {high}) instead of "
        f"{length(heldout['after']['rms_m'])}: a change of the error by {fall[0]} to {fall[1]} %. Of the squared error that "
        f"the declared model leaves, the effects explain {shares['physics']} and the regression {shares['regression_share']}; "
        f"{shares['left']} is left."
    )
    widths = remainder["half_width_m"]
    if widths and remainder["covered"] is not None:
        beyond = f", ± {length(widths['outside'])} outside" if widths["outside"] is not None else ""
        within = f"± {length(widths['within'])} within the range of the fitted poses" if widths["within"] is not None else ""
        sentence += (
            f" Its 95 % intervals, {within}{beyond} (median of a coordinate), hold {percent(remainder['covered'])} of the "
            "coordinates."
        )
    if remainder["outside"]:
        sentence += f" At the {counted(remainder['outside'], 'pose')} outside the range of the fitted ones it corrects nothing."
    return sentence + " It names no cause and is not part of the exported model."


def _before_and_after(before: str, after: str) -> str:
    return after if before == after else f"{before} before and {after} after"


def _error_unit(lengths_m: Sequence[float]) -> tuple[float, str]:
    return (MILLI, "mm") if max(lengths_m) >= 1e-3 else (MICRO, "µm")


def _number(value: float, unit: str) -> str:
    return f"{value:.3f}" if unit == "mm" else minus(f"{value:.0f}")


def _interval(row: Mapping[str, Any], name: str, factor: float, unit: str) -> str:
    low, high = (factor * row[f"{name}_{end}"] for end in ("low", "high"))
    if np.isnan(low) or np.isnan(high):
        return "–"
    return f"≥ {_number(low, unit)}" if np.isinf(high) else f"[{_number(low, unit)}, {_number(high, unit)}]"
