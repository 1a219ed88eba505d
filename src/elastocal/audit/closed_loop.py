"""The closed loop and the worth of plans: errors of each case, together with intervals, and goals, from the commanded poses."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

_MODELS = ("uncorrected", "geometry", "declared", "found", "true")
_PARTS = ("unloaded", "loaded", "milling")
_REPLICATES = 2000
# A case reaches the goal within so many times what the true model leaves.
_GOAL = 1.2
_DIGITS = 1e-8
_KEY = ["robot", "effect", "seed", "part"]


def moved(run: Audited, file: str, robot: str) -> list[Finding]:
    """Every pose of a case is commanded by every model."""
    frame = run.table(file)
    each = pd.crosstab([frame[name] for name in ("effect", "seed", "part", "pose")], frame["model"])
    right = set(each) == set(_MODELS) and bool((each == 1).to_numpy().all())
    found = [held(file, f"every pose of {robot} by every model once", "pandas", right, "not so", len(frame))]
    verdicts = frame.groupby(["effect", "seed"])[["verdict", "named"]].nunique()
    alike = bool((verdicts == 1).to_numpy().all())
    return [*found, held(file, "one verdict a case", "pandas", alike, "several", len(verdicts))]


def cases(run: Audited, file: str) -> list[Finding]:
    """Errors of each case and part, from all poses that every model could correct."""
    stated = run.table(file)
    frame = _all_poses(run, stated)
    frame["kept"] = frame.groupby([*_KEY, "pose"])["corrected"].transform("min")
    frame = frame[frame["kept"].astype(bool)]
    found = []
    rows = stated.set_index(_KEY).sort_index()
    for suffix, column in (("", "measured_error_m"), ("_reached", "reached_error_m")):
        squares = frame.assign(square=frame[column] ** 2).pivot_table(index=_KEY, columns="model", values="square")
        found.append(held(file, f"cases and parts{suffix}", "counting", squares.index.equals(rows.index), "others", len(rows)))
        if not found[-1].holds:
            return found
        for model in _MODELS:
            checked = f"RMS of {model}{suffix}"
            found.append(compared(file, checked, "pandas", rows[f"{model}{suffix}"], squares[model] ** 0.5, _DIGITS))
    mine = frame[frame["model"] == "found"].set_index(_KEY)[["reached_error_m", "predicted_std_m"]]
    means = (mine**2).groupby(_KEY).mean()
    expected = means["reached_error_m"] / means["predicted_std_m"]
    found.append(compared(file, "squares reached over squares predicted", "pandas", rows["calibration"], expected, _DIGITS))
    over = rows["found"] / rows["true"]
    found.append(compared(file, "over the floor", "pandas", rows["over_floor"], over, 2 * _DIGITS))
    reported = frame.groupby(_KEY)[["verdict", "named"]].first()
    alike = bool((rows[["verdict", "named"]] == reported).to_numpy().all())
    return [*found, held(file, "verdicts", "pandas", alike, "others", len(rows))]


def _all_poses(run: Audited, stated: pd.DataFrame) -> pd.DataFrame:
    robots = stated["robot"].unique()
    return pd.concat([run.table(f"results/closed_loop/{robot}.parquet").assign(robot=robot) for robot in robots])


def together(run: Audited, file: str) -> list[Finding]:
    """Errors of all cases together, by robot, part and model, with bootstrap intervals over cases."""
    stated, errors = run.table(file), run.table(file.replace("closed_loop.csv", "cases.csv"))
    rows = []
    for robot in [*errors["robot"].unique(), "all"]:
        for part in _PARTS:
            mine = errors[(errors["part"] == part) & (True if robot == "all" else errors["robot"] == robot)]
            generator = numbers(run.seed, robot, f"closed loop {part}", 0)
            chosen = generator.integers(len(mine), size=(_REPLICATES, len(mine)))
            rows += [_of_model(mine, chosen, model) | {"robot": robot, "part": part} for model in _MODELS]
    expected = pd.DataFrame(rows)
    names = ["robot", "part", "model"]
    found = [held(file, "robots, parts and models", "counting", stated[names].equals(expected[names]), "others", len(stated))]
    if found[0].holds:
        for name in stated.columns.drop(names):
            by = "numpy's Philox stream"
            # Ratios of what was written with nine digits.
            found.append(compared(file, name, by, stated[name], expected[name], 2 * _DIGITS, scale=expected[name]))
    return found


def _of_model(errors: pd.DataFrame, chosen: np.ndarray, model: str) -> dict[str, Any]:
    """RMS of a model with and without the tracker's noise and over the floor, each with its limits."""
    square, floor = errors[model].to_numpy() ** 2, errors["true"].to_numpy() ** 2
    reached = errors[f"{model}_reached"].to_numpy() ** 2

    def means(values: np.ndarray) -> np.ndarray:
        return np.array([values[row].mean() for row in chosen])

    figures = {
        "rms_mm": (1e3 * np.sqrt(square.mean()), 1e3 * np.sqrt(means(square))),
        "over_floor": (np.sqrt(square.mean() / floor.mean()), np.sqrt(means(square) / means(floor))),
        "reached_mm": (1e3 * np.sqrt(reached.mean()), 1e3 * np.sqrt(means(reached))),
    }
    row: dict[str, Any] = {"model": model, "cases": len(errors)}
    for name, (value, drawn) in figures.items():
        low, high = np.percentile(drawn, [2.5, 97.5])
        row |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return row


def goals(run: Audited, file: str) -> list[Finding]:
    """How many cases reach the goal, with Wilson's interval."""
    stated, errors, rows = run.table(file), run.table(file.replace("goals.csv", "cases.csv")), []
    for part in _PARTS:
        for named in (True, False):
            mine = errors[(errors["part"] == part) & (errors["named"] == named)]
            if not len(mine):
                continue
            within = int((mine["over_floor"] <= _GOAL).sum())
            ends = stats.binomtest(within, len(mine)).proportion_ci(0.95, "wilson")
            row = {"part": part, "named": named, "cases": len(mine), "within": within, "share": within / len(mine)}
            row |= {"share_low": ends.low, "share_high": ends.high}
            rows.append(row | {f"median_{name}": mine[name].median() for name in ("over_floor", "calibration")})
    expected = pd.DataFrame(rows)
    words = bool(len(stated) == len(expected) and (stated[["part", "named"]] == expected[["part", "named"]]).to_numpy().all())
    found = [held(file, "parts, named and not", "counting", words, "others", len(stated))]
    if words:
        names = stated.columns.drop(["part", "named"])
        found.append(compared(file, "cases within the goal", "scipy's binomtest", stated[names], expected[names], _DIGITS))
    return found


def gains(run: Audited, file: str) -> list[Finding]:
    """The table of plans says what the files of the robots say."""
    stated, found = run.table(file), []
    for row in stated.to_dict("records"):
        document = run.document(f"results/planning/{row['robot']}.json")
        names = set(document) | {"robot"} == set(row)
        found.append(held(file, f"columns of {row['robot']}", "pandas", names, f"{set(document) ^ set(row)}", len(row)))
        values = [(row[name], value) for name, value in document.items() if not isinstance(value, str)]
        pairs = np.array([(np.nan if a is None else a, np.nan if b is None else b) for a, b in values], float).reshape(-1, 2)
        scale = np.nan_to_num(np.abs(pairs[:, 1]))
        found.append(compared(file, f"figures of {row['robot']}", "json", pairs[:, 0], pairs[:, 1], _DIGITS, scale=scale))
    return found


CHECKS = (
    (re.compile(r"results/closed_loop/([^/]+)\.parquet"), moved),
    (re.compile(r"reports/closed_loop/cases\.csv"), cases),
    (re.compile(r"reports/closed_loop/closed_loop\.csv"), together),
    (re.compile(r"reports/closed_loop/goals\.csv"), goals),
    (re.compile(r"reports/planning/gains\.csv"), gains),
)
