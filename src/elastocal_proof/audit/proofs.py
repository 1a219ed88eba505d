"""Blind proof, closed loop, plans, bad rows and league: seals, what verdicts are worth, errors, rates, and who predicts what.

Bootstrap intervals, calibration and coverage are those of the package, which golden tables of the tests hold; intervals of
rates are scipy's.
"""

from __future__ import annotations

import hashlib
import json
import re
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

from elastocal_proof.audit.elastic import find_configurations
from elastocal_proof.audit.findings import Finding, compare, compare_columns, require
from elastocal_proof.audit.streams import numbers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from elastocal_proof.audit.audited import Audited

    _Document = Mapping[str, Any]

_MODELS = ("uncorrected", "geometry", "declared", "found", "true")
# A case of the closed loop reaches the goal within so many times what the true model leaves.
_GOAL = 1.2
# Of what is worked out of a table with nine digits.
_OF_DIGITS = 1e-7
_CASE = ["robot", "effect", "seed", "part"]


def _manifest(run: Audited) -> dict[str, str]:
    lines = (run.folder / "reports/blind/manifest.sha256").read_text("utf-8").splitlines()
    return {file: digest for digest, _, file in (line.partition("  ") for line in lines)}


def _entries(run: Audited) -> dict[str, _Document]:
    """Verdicts by the names of cases."""
    paths = sorted((run.folder / "results/blind").glob("*.json"))
    return {entry["campaign"]: entry for path in paths for entry in json.loads(path.read_text("utf-8"))}


def seals(run: Audited, file: str) -> Iterator[Finding]:
    """Every ground truth is what was sealed, and every sealed one is there."""
    there = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in (run.folder / "data/sealed").glob("*/*.json")}
    listed = _manifest(run)
    off = [name for name, digest in listed.items() if there.get(name) != digest]
    yield require("ground truths as they were sealed", "hashlib, SHA-256", not off, ", ".join(off[:3]), len(listed))


def cases(run: Audited, file: str) -> Iterator[Finding]:
    """What every verdict is worth, from the sealed ground truths; held-out errors of the verdicts and of the oracle."""
    paths, verdicts, oracles = sorted((run.folder / "data/sealed").glob("*/*.json")), _entries(run), dict[str, Any]()
    for path in sorted((run.folder / "results/blind/oracle").glob("*.json")):
        oracles |= json.loads(path.read_text("utf-8"))
    listed, rows = _manifest(run), []
    for path in paths:
        if path.name in listed:
            verdict, (oracle, limit) = verdicts[path.stem], (oracles[path.stem][name] for name in ("oracle", "limit"))
            names = ("before_rms_m", "after_rms_m", "reduction", "reduction_std_error", "oracle_p_value", "oracle_rms_m")
            row = judge(json.loads(path.read_text("utf-8")), verdict) | {"case": path.stem} | dict.fromkeys(names, np.nan)
            if (held_out := verdict["heldout"]) is not None:
                before, after = (held_out[state]["rms_m"] for state in ("before", "after"))
                row |= {"before_rms_m": before, "after_rms_m": after, "reduction": 1 - after / before}
                row["reduction_std_error"] = held_out["reduction_std_error"]
            if oracle is not None:
                row |= {"oracle_p_value": oracle["p_value"], "oracle_rms_m": oracle["heldout"]["rms_m"]}
            row |= {f"limit_{name}": np.nan if limit is None else float(limit[name]) for name in ("detected", "right")}
            rows.append(row)
    # Joints are words, such as 2-3, although one alone looks like a number.
    stated = pd.read_csv(run.folder / file, dtype={"joints": str})
    yield from compare_columns(stated, pd.DataFrame(rows), ["case"], "json and pandas")


def judge(truth: _Document, verdict: _Document) -> dict[str, Any]:
    """What a verdict is worth; where the base is misplaced, to find so is right, and the rest is judged alone."""
    word, true = verdict["verdict"], list(truth["case"]["effects"])
    effects = [effect for effect in verdict["effects"] if effect["name"] != "base_placement" or "misplaced" not in truth]
    if len(effects) < len(verdict["effects"]):
        single = "class" if any(effect["alternatives"] for effect in effects) else "named"
        word = {0: "adequate", 1: single}.get(len(effects), "several")
    names = [effect["name"] for effect in effects]
    stated = bool(true) and word in ("named", "class", "several")
    exact = stated and sorted(true) == sorted(names)
    meant = [{effect["name"], *(re.split(r"[@\[]", other)[0] for other in effect["alternatives"])} for effect in effects]
    orders = permutations(meant) if len(true) == len(meant) else ()
    matched = any(all(name in among for name, among in zip(true, order, strict=True)) for order in orders)
    found = {"truth": " + ".join(true) or "none", "verdict": word, "found": " + ".join(names) or "none", "exact": exact}
    found |= {"named_right": exact and word == "named", "holds_truth": stated and matched}
    return found | {"detected": word not in ("adequate", "not_testable"), "wrong_name": word == "named" and names != true}


def probabilities(run: Audited, file: str) -> Iterator[Finding]:
    """What was stated of each case: the most probable mechanisms, and the smallest set that reaches 95 %."""
    rows = []
    verdicts = _entries(run)
    for case in (file.removesuffix(".json") for file in _manifest(run)):
        stated = verdicts[case].get("probabilities") or {}
        if sets := sorted(stated.get("sets", ()), key=lambda entry: -entry["probability"]):
            reached = np.cumsum([entry["probability"] for entry in sets])
            size = min(int(np.searchsorted(reached, 0.95)) + 1, len(sets))
            row = {"case": case, "stated": reached[0], "top": " + ".join(sorted(sets[0]["mechanisms"])) or "none"}
            row |= {"set_size": size, "set_probability": reached[size - 1]}
            rows.append(row | {name: stated[name] for name in ("nothing", "alarm_p_value")})
    again = pd.DataFrame(rows) if rows else pd.DataFrame(columns=["case"])
    yield from compare_columns(run.table(file), again, ["case"], "json and pandas")


def rates(run: Audited, file: str) -> Iterator[Finding]:
    """Rates and their Clopper-Pearson limits from what is counted; targets from their words."""
    stated = run.table(file)
    counts = stated[["hits", "cases"]].to_numpy(float)
    again = pd.DataFrame([_rate(*row) for row in counts]).assign(row=stated.index)
    if "target" in stated:
        again = again.join(pd.DataFrame([_target(row) for row in stated.to_dict("records")]))
    yield from compare_columns(stated.assign(row=stated.index), again, ["row"], "scipy", _OF_DIGITS)


def _rate(hits: float, cases: float) -> dict[str, Any]:
    """A share of cases and its interval; without cases all there is, and NA of what is no share."""
    if np.isnan(hits):
        return dict.fromkeys(("rate", "low", "high"), pd.NA)
    ends = stats.binomtest(int(hits), int(cases)).proportion_ci(0.95, "exact") if cases else (0.0, 1.0)
    return {"rate": hits / cases if cases else np.nan, "low": ends[0], "high": ends[1]}


def _target(row: Mapping[Any, Any]) -> dict[str, Any]:
    """The range that the words of a target mean, and whether a figure lies in it."""
    words = "" if pd.isna(row["target"]) else row["target"]
    if isinstance(words, float):
        return {"holds": str(row["rate"] >= words) if row["cases"] else ""}
    shares = [float(number) / 100 for number in re.findall(r"[\d.]+", words)] or [np.nan]
    low, high = 0.0, shares[0]
    if "at least" in words or not words:
        low, high = shares[0], np.inf if "of the limit" in words else 1.0 if words else np.nan
    elif "within" in words or " to " in words:
        low, high = (0.0, 1 + shares[0]) if "within" in words else tuple(shares)
    holds = low <= row["rate"] <= high
    holds &= row["low"] > shares[-1] if "lower limit" in words else row["high"] < shares[0] if "upper limit" in words else True
    return {"target_low": low, "target_high": high, "holds": str(bool(holds)) if words and row["cases"] else ""}


def power(run: Audited, file: str) -> Iterator[Finding]:
    """Limits of the rates of detection by effect and size."""
    stated = run.table(file)
    again = stated[["robots", "group", "effect", "level"]].copy()
    for name, of in (("detected", "cases"), ("held", "cases"), ("named", "cases"), ("oracle_detected", "oracle_cases")):
        counts = zip((stated[name] * stated[of]).fillna(0).round(), stated[of], strict=True)
        again[[name, f"{name}_low", f"{name}_high"]] = [[*_rate(*row).values()] for row in counts]
    yield from compare_columns(stated, again, ["robots", "group", "effect", "level"], "scipy", _OF_DIGITS)


def confusion(run: Audited, file: str) -> Iterator[Finding]:
    """Every case stands once among the counts of ground truths against verdicts."""
    stated, count = run.table(file), len(run.table("reports/blind/cases.csv"))
    every = int(stated.drop(columns=["robots", "settings", "truth", "level"]).to_numpy().sum())
    yield require("every case once", "counting", every == count, f"{every} of {count}", count)


def moved(run: Audited, file: str, robot: str) -> Iterator[Finding]:
    """Every pose of a case of the closed loop is commanded by every model."""
    frame = run.table(file)
    each = pd.crosstab([frame[name] for name in ("effect", "seed", "part", "pose")], frame["model"])
    right = set(each) == set(_MODELS) and (each == 1).to_numpy().all()
    yield require(f"every pose of {robot} by every model once", "pandas", right, "not so", len(frame))
    verdicts = frame.groupby(["effect", "seed"])[["verdict", "named"]].nunique()
    yield require("one verdict a case", "pandas", (verdicts == 1).to_numpy().all(), "several", len(verdicts))


def corrected(run: Audited, file: str) -> Iterator[Finding]:
    """Errors of each case and part of the closed loop, from all poses that every model could correct."""
    stated = run.table(file)
    robots = stated["robot"].unique()
    frame = pd.concat([run.table(f"results/closed_loop/{robot}.parquet").assign(robot=robot) for robot in robots])
    frame = frame[frame.groupby([*_CASE, "pose"])["corrected"].transform("min").astype(bool)]
    columns = {"": "measured_error_m", "_reached": "reached_error_m", "_predicted": "predicted_std_m"}
    squares = frame[[*columns.values()]] ** 2
    means = squares.groupby([frame[name] for name in (*_CASE, "model")]).mean().unstack()
    again = frame.groupby(_CASE)[["verdict", "named"]].first()
    for end, column in columns.items():
        again = again.join(np.sqrt(means[column]).add_suffix(end))
    again["calibration"] = (again["found_reached"] / again["found_predicted"]) ** 2
    again["over_floor"] = again["found"] / again["true"]
    yield from compare_columns(stated, again.reset_index(), _CASE, relative=2e-8)


def together(run: Audited, file: str) -> Iterator[Finding]:
    """Errors of all cases of the closed loop together, by robot, part and model, and over the floor."""
    errors = run.table(file.replace("closed_loop.csv", "cases.csv"))
    both = pd.concat([errors, errors.assign(robot="all")]).set_index(["robot", "part"]).select_dtypes("number") ** 2
    means, rows = np.sqrt(both.groupby(level=[0, 1]).mean()), []
    for model in _MODELS:
        row = {"rms_mm": 1e3 * means[model], "reached_mm": 1e3 * means[f"{model}_reached"]}
        rows.append(pd.DataFrame(row | {"over_floor": means[model] / means["true"], "model": model}))
    yield from compare_columns(run.table(file), pd.concat(rows).reset_index(), ["robot", "part", "model"], relative=2e-8)


def goals(run: Audited, file: str) -> Iterator[Finding]:
    """How many cases of the closed loop reach the goal, with Wilson's interval."""
    rows = []
    for (part, named), mine in run.table(file.replace("goals.csv", "cases.csv")).groupby(["part", "named"]):
        within = int((mine["over_floor"] <= _GOAL).sum())
        ends = stats.binomtest(within, len(mine)).proportion_ci(0.95, "wilson")
        row = {"part": part, "named": named, "cases": len(mine), "within": within, "share": within / len(mine)}
        row |= {f"median_{name}": mine[name].median() for name in ("over_floor", "calibration")}
        rows.append(row | {"share_low": ends.low, "share_high": ends.high})
    yield from compare_columns(run.table(file), pd.DataFrame(rows), ["part", "named"], "scipy's binomtest", 1e-8)


def gains(run: Audited, file: str) -> Iterator[Finding]:
    """The table of plans says what the files of the robots say."""
    stated = run.table(file)
    again = [{"robot": robot} | run.document(f"results/planning/{robot}.json") for robot in stated["robot"]]
    yield from compare_columns(stated, pd.DataFrame(again), ["robot"], "json")


def bad_rows(run: Audited, file: str) -> Iterator[Finding]:
    """Every slip is there once, and verdicts count as the same that are."""
    stated = run.table(file)
    robots = stated["robot"].unique()
    slips = pd.concat([run.table(f"results/bad_rows/{robot}.parquet").assign(robot=robot) for robot in robots])
    for version in ("damaged", "fewer"):
        same = [slips[f"{version}_{what}"] == slips[f"clean_{what}"] for what in ("verdict", "found")]
        slips[f"{version}_same"] = same[0] & same[1]
    # Slips of a case are in the order of the file.
    numbered = [each.assign(slip=np.arange(len(each))) for each in (stated, slips)]
    yield from compare_columns(numbered[0], numbered[1], ["slip"])


def folds(run: Audited, file: str, data: str) -> Iterator[Finding]:
    """Random folds of the configurations from their stream; blocks of joint space by their sizes."""
    frame = run.table(file)
    poses = run.table(f"results/league/{data}/measurements.parquet").groupby(["session", "pose"]).mean(numeric_only=True)
    yield compare("every measured pose once", "counting", frame[["session", "pose"]], poses.index.to_frame(), 0.0)
    count, configuration = int(frame["random"].max()), find_configurations(poses.filter(regex=r"^q\d+$").to_numpy())
    dealt = numbers(run.seed, data, "league folds").permutation(configuration.max() + 1)[configuration] % count + 1
    yield compare("random folds", "numpy's Philox stream", frame["random"], dealt, 0.0)
    blocks = frame["blocks"].groupby(configuration)
    sizes = blocks.first().value_counts()
    even = len(sizes) == count and sizes.max() - sizes.min() <= 1 and blocks.nunique().eq(1).all()
    yield require("blocks of like size", "counting", even, f"{sorted(sizes)}", len(sizes))


def entries(run: Audited, file: str, data: str, split: str, method: str) -> Iterator[Finding]:
    """Every pose is predicted in the fold that holds it out; probabilities of mechanisms stand once a fold."""
    frame = run.table(file)
    if method == "mechanisms":
        right = frame["probability"].between(0, 1 + 1e-9).all() and not frame.duplicated(["fold", "mechanism"]).any()
        yield require("probabilities of mechanisms", "counting", right, "beyond 0 to 1, or twice", len(frame))
    elif split == "session" and method != "fits":
        right = (frame["set"] >= 1).all() and (frame["fold"] == 1).all()
        yield require("another data set is predicted", "pandas", right, "its own", len(frame))
    elif method != "fits":
        dealt = run.table(f"results/league/{data}/folds.parquet")[["session", "pose", split]]
        each = frame[["session", "pose", "fold"]].drop_duplicates().sort_values(["session", "pose"])
        yield compare("each pose in the fold that holds it out", "pandas", each, dealt, 0.0)
        keys = ["session", "pose", "load", "target"]
        measured = run.table(f"results/league/{data}/measurements.parquet")[keys].drop_duplicates()
        # A state that is approached from several sides is predicted for each, and outlying repeats need not leave one.
        found = len(frame[keys].merge(measured))
        yield require("only what was measured", "pandas", found == len(frame), f"{found} of {len(frame)} rows", len(frame))


def league(run: Audited, file: str, league: str) -> Iterator[Finding]:
    """Errors of every method from its entries, their ratios, and how often intervals hold."""
    stated, reference, rows = run.table(file), run.configuration["league"]["reference"], []
    for (data, split), some in stated.groupby(["data", "split"], sort=False):
        right = {*some["method"]} == {*run.configuration["league"]["methods"]}
        yield require(f"methods of {data}, {split}", "config.yaml", right, ", ".join(some["method"]), len(some))
        part = []
        for method in some["method"]:
            frame = run.table(f"results/league/{data}/{split}/{method}.parquet")
            off, std = frame[["dx", "dy", "dz"]].to_numpy(), frame[["std_x", "std_y", "std_z"]].to_numpy()
            size, poses = 1e3 * np.linalg.norm(off, axis=1), frame.groupby(["set", "session", "pose"])["outside_range"].first()
            inside = (np.abs(off) < stats.norm.ppf(0.975) * std).mean() if np.isfinite(std).all() else np.nan
            row = {
                "data": data,
                "split": split,
                "method": method,
                "poses": len(poses),
                "outside": poses.mean(),
                "covered": inside,
            }
            row |= {"rms_mm": np.sqrt((size**2).mean()), "p95_mm": np.percentile(size, 95), "max_mm": size.max()}
            part.append(row | {"share_below_max": 0.05 ** (1 / len(poses))})
        rms = {row["method"]: row["rms_mm"] for row in part}
        rows += [
            row | {"ratio": row["rms_mm"] / rms[reference], "ratio_to_best": row["rms_mm"] / min(rms.values())} for row in part
        ]
    yield from compare_columns(stated, pd.DataFrame(rows), ["data", "split", "method"], "numpy and scipy", 1e-8)


def mechanism_table(run: Audited, file: str, league: str) -> Iterator[Finding]:
    """Mechanisms over the folds of the random split: mean, least and largest; a fold that does not list one counts as zero."""
    stated, rows = run.table(file), []
    for data in stated["data"].unique():
        frame = run.table(f"results/league/{data}/random/mechanisms.parquet").pivot(index="mechanism", columns="fold")
        # As many as were dealt: the league may have been asked for others than the configuration has.
        every = range(1, int(run.table(f"results/league/{data}/folds.parquet")["random"].max()) + 1)
        for mechanism in frame.index:
            row = {"data": data, "mechanism": mechanism}
            for name in ("probability", "share"):
                values = frame.loc[mechanism, name].reindex(every).fillna(0)
                row |= {name: values.mean(), f"{name}_low": values.min(), f"{name}_high": values.max()}
            rows.append(row)
    again = pd.DataFrame(rows) if rows else pd.DataFrame(columns=["data", "mechanism"])
    yield from compare_columns(stated, again, ["data", "mechanism"], relative=1e-8)


CHECKS = {
    "reports/blind/manifest.sha256": seals,
    "reports/blind/cases.csv": cases,
    "reports/blind/probabilities.csv": probabilities,
    **{f"reports/blind/{name}.csv": rates for name in ("summary", "reliability", "settings", "coverage")},
    "reports/blind/power.csv": power,
    "reports/blind/confusion.csv": confusion,
    "results/closed_loop/{robot}.parquet": moved,
    "reports/closed_loop/cases.csv": corrected,
    "reports/closed_loop/closed_loop.csv": together,
    "reports/closed_loop/goals.csv": goals,
    "reports/planning/gains.csv": gains,
    "reports/bad_rows/cases.csv": bad_rows,
    "reports/bad_rows/summary.csv": rates,
    "results/league/{data}/folds.parquet": folds,
    "results/league/{data}/{split}/{method}.parquet": entries,
    "reports/league/{league}/league.csv": league,
    "reports/league/{league}/mechanisms.csv": mechanism_table,
}
