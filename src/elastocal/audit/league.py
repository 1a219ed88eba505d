"""The league: folds from their stream, which pose is predicted where, and its tables from the entries of each method."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

from elastocal.audit.configurations import configurations
from elastocal.audit.findings import Finding, compared, held
from elastocal.audit.intervals import Errors, distances, drawn, limits, metrics, reduction
from elastocal.audit.streams import numbers

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

_DIGITS = 1e-8
_POSE = ["set", "session", "pose"]
_BY = "numpy's Philox stream, jackknife"


def folds(run: Audited, file: str, data: str) -> list[Finding]:
    """Random folds of the configurations from their stream; blocks of joint space by their sizes."""
    frame = run.table(file)
    poses = run.table(f"results/league/{data}/measurements.parquet").groupby(["session", "pose"]).mean(numeric_only=True)
    expected = poses.index.to_frame().to_numpy()
    found = [compared(file, "every measured pose once", "counting", frame[["session", "pose"]], expected, 0.0)]
    count = int(frame["random"].max())
    configuration = configurations(poses.filter(regex=r"^q\d+$").to_numpy())
    dealt = numbers(run.seed, data, "league folds", 0).permutation(configuration.max() + 1)[configuration] % count + 1
    found.append(compared(file, "random folds", "numpy's Philox stream", frame["random"], dealt, 0.0))
    blocks = frame["blocks"].groupby(configuration)
    sizes = blocks.first().value_counts()
    even = len(sizes) == count and sizes.max() - sizes.min() <= 1 and (blocks.max() == blocks.min()).all()
    return [*found, held(file, "blocks of like size", "counting", bool(even), f"{sorted(sizes)}", len(sizes))]


def entries(run: Audited, file: str, data: str, split: str) -> list[Finding]:
    """Every pose is predicted in the fold that holds it out, and in no other."""
    frame = run.table(file)
    if split == "session":
        right = bool((frame["set"] >= 1).all() and (frame["fold"] == 1).all())
        return [held(file, "another data set is predicted", "pandas", right, "its own", len(frame))]
    dealt = run.table(f"results/league/{data}/folds.parquet")
    each = frame[["session", "pose", "fold"]].drop_duplicates().sort_values(["session", "pose"])
    expected = dealt[["session", "pose", split]]
    found = [compared(file, "each pose in the fold that holds it out", "pandas", each, expected, 0.0)]
    measured = run.table(f"results/league/{data}/measurements.parquet")[["session", "pose", "load", "target"]]
    most = len(measured.drop_duplicates())
    keys = frame[["session", "pose", "load", "target"]]
    # A state that is approached from several sides is predicted for each, and outlying repeats need not leave one.
    some = len(keys.merge(measured.drop_duplicates())) == len(keys)
    return [*found, held(file, "only what was measured", "pandas", some, f"{len(keys)} rows of {most} measured", len(keys))]


def mechanisms(run: Audited, file: str, data: str, split: str) -> list[Finding]:
    """Probabilities and shares of mechanisms, each once a fold."""
    frame = run.table(file)
    right = bool(frame["probability"].between(0, 1 + 1e-9).all() and not frame.duplicated(["fold", "mechanism"]).any())
    return [held(file, f"probabilities of {data}, {split}", "counting", right, "beyond 0 to 1, or twice", len(frame))]


def table(run: Audited, file: str, league: str) -> list[Finding]:
    """Every row of the table of methods, from their entries."""
    stated, settings = run.table(file), run.configuration["league"]
    robot_of = {data: robot for robot, names in settings["data"][league].items() for data in names}
    found = []
    for (data, split), rows in stated.groupby(["data", "split"], sort=False):
        expected = pd.DataFrame(_rows(run, str(data), str(split), rows["method"].tolist(), settings["reference"]))
        words = bool((rows["robot"] == robot_of[str(data)]).all() and set(rows["method"]) == set(settings["methods"]))
        found.append(
            held(file, f"robot and methods of {data}, {split}", "config.yaml", words, str(set(rows["robot"])), len(rows))
        )
        for name in expected:
            checked = f"{name} of {data}, {split}"
            scale = expected[name].abs().fillna(0)
            found.append(compared(file, checked, _BY, rows[name], expected[name], _DIGITS, scale=scale))
    cells = stated.drop(columns=["data", "split", "method"])
    checked = f"{cells.size} of {cells.size} cells followed"
    return [
        *found,
        held(file, checked, "pandas", set(stated) - {"data", "split", "method", "robot"} == set(expected), "columns"),
    ]


def _rows(run: Audited, data: str, split: str, methods: list[str], reference: str) -> list[dict[str, Any]]:
    frames = [run.table(f"results/league/{data}/{split}/{method}.parquet") for method in methods]
    pose = frames[0].groupby(_POSE).ngroup().to_numpy()
    errors = Errors(distances([frame[["dx", "dy", "dz"]].to_numpy() for frame in frames]), pose)
    counts, again = (drawn(numbers(run.seed, data, f"league {split}", part), errors.poses) for part in (0, 1))
    figures = [metrics(each) for each in errors.distances]
    first = methods.index(reference)
    best = min(range(len(methods)), key=lambda number: figures[number]["rms"])
    rows = []
    for number, frame in enumerate(frames):
        figure = figures[number]
        low, high = limits(errors, counts, number)["rms"]
        row: dict[str, Any] = {"poses": errors.poses, "rms_mm": 1e3 * figure["rms"], "rms_low_mm": 1e3 * low}
        row |= {"rms_high_mm": 1e3 * high, "p95_mm": 1e3 * figure["p95"], "max_mm": 1e3 * figure["max"]}
        row["share_below_max"] = 0.05 ** (1 / errors.poses)
        for name, other, replicates in (("ratio", first, counts), ("ratio_to_best", best, again)):
            fallen = reduction(errors, replicates, other, number)
            row[name] = figure["rms"] / figures[other]["rms"]
            row |= {f"{name}_low": 1 - fallen[1], f"{name}_high": 1 - fallen[0]}
        std = frame[["std_x", "std_y", "std_z"]].to_numpy()
        inside = np.abs(frame[["dx", "dy", "dz"]].to_numpy()) < stats.norm.ppf(0.975) * std
        row["covered"] = inside.mean() if np.isfinite(std).all() else np.nan
        row["outside"] = frame.groupby(_POSE)["outside_range"].first().mean()
        rows.append(row)
    return rows


def mechanism_table(run: Audited, file: str, league: str) -> list[Finding]:
    """Mechanisms over the folds of the random split: mean, least and largest; a fold that does not list one counts as zero."""
    stated, settings, found = run.table(file), run.configuration["league"], []
    robot_of = {data: robot for robot, names in settings["data"][league].items() for data in names}
    for data, rows in stated.groupby("data", sort=False):
        frame = run.table(f"results/league/{data}/random/mechanisms.parquet")
        # As many as were dealt: the league may have been asked for others than the configuration has.
        count = int(run.table(f"results/league/{data}/folds.parquet")["random"].max())
        names = set(frame["mechanism"]) == set(rows["mechanism"]) and len(rows) == frame["mechanism"].nunique()
        right = names and bool((rows["robot"] == robot_of[str(data)]).all())
        found.append(held(file, f"mechanisms of {data}", "pandas", right, "others", len(rows)))
        if not right:
            continue
        for quantity in ("probability", "share"):
            wide = frame.pivot(index="mechanism", columns="fold", values=quantity)
            wide = wide.reindex(columns=range(1, count + 1)).fillna(0).loc[rows["mechanism"]]
            expected = np.stack([wide.mean(axis=1), wide.min(axis=1), wide.max(axis=1)], axis=1)
            values = rows[[quantity, f"{quantity}_low", f"{quantity}_high"]]
            found.append(compared(file, f"{quantity} of {data}", "pandas", values, expected, _DIGITS))
    return found


CHECKS = (
    (re.compile(r"results/league/([^/]+)/folds\.parquet"), folds),
    (re.compile(r"results/league/([^/]+)/(\w+)/mechanisms\.parquet"), mechanisms),
    (re.compile(r"results/league/([^/]+)/(\w+)/(?!fits|mechanisms)\w+\.parquet"), entries),
    (re.compile(r"reports/league/([^/]+)/league\.csv"), table),
    (re.compile(r"reports/league/([^/]+)/mechanisms\.csv"), mechanism_table),
)
