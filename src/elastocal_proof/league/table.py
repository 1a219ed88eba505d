"""The table of the league: errors of every method on poses that it has not seen, with intervals, and what they cost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.campaigns.groups import groups_of
from elastocal.random_streams import stream
from elastocal.remainder.tuning import NORMAL_WIDTH
from elastocal.validation.held_out import Errors, intervals, share_below_largest, summary
from elastocal_proof.league.methods import DIAGNOSIS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from elastocal_proof.league.methods import Method

    # Rows of the entries table by data set, split and method.
    Entries = Mapping[tuple[str, str, str], pd.DataFrame]

_REPLICATES = 1000
_POSE = ["set", "session", "pose"]


def league_table(entries: Entries, robots: Mapping[str, Sequence[str]], reference: str, seed: int) -> pd.DataFrame:
    """One row for each data set, split and method.

    `entries`: all methods of a data set and split predict the same poses. `robots`: data sets by the names of their robots.
    `reference`: method whose RMS the others' are divided by. `seed`: of the bootstrap over poses. Returns ``robot, data, split,
    method, poses``; ``rms_mm`` with 95 % limits over poses, ``p95_mm``, ``max_mm`` and the share of all poses that stay below
    it at 95 % confidence; ``ratio``, the RMS over that of the reference on the same poses, with 95 % limits; ``ratio_to_best``
    the same over the best of the row's data set and split; ``covered``, the share of coordinates inside the 95 % intervals that
    the method states; ``outside``, the share of poses outside the range of the training poses.
    """
    robot_of = {data: robot for robot, names in robots.items() for data in names}
    rows: list[dict[str, Any]] = []
    for data, split in dict.fromkeys(key[:2] for key in entries):
        mine = {method: part for (name, way, method), part in entries.items() if (name, way) == (data, split)}
        errors = [_errors(part) for part in mine.values()]
        rms = np.array([summary(error.distance)["rms_m"] for error in errors])
        places = {"ratio": list(mine).index(reference), "ratio_to_best": int(np.argmin(rms))}
        limits, over = intervals(errors, _REPLICATES, stream(seed, data, f"league {split}", 0), places["ratio"])
        to_best = intervals(errors, _REPLICATES, stream(seed, data, f"league {split}", 1), places["ratio_to_best"])[1]
        for number, (method, part) in enumerate(mine.items()):
            figures, (low, high) = summary(errors[number].distance), limits[number]["rms_m"]
            row: dict[str, Any] = {"robot": robot_of[data], "data": data, "split": split, "method": method}
            row |= {
                "poses": errors[number].poses,
                "rms_mm": 1e3 * rms[number],
                "rms_low_mm": 1e3 * low,
                "rms_high_mm": 1e3 * high,
            }
            row |= {"p95_mm": 1e3 * figures["p95_m"], "max_mm": 1e3 * figures["max_m"]}
            row |= {"share_below_max": share_below_largest(errors[number].poses)}
            for (name, place), reduction in zip(places.items(), (over, to_best), strict=True):
                ends = {f"{name}_low": 1.0 - reduction[number].high, f"{name}_high": 1.0 - reduction[number].low}
                row |= {name: rms[number] / rms[place]} | ends
            outside = part.groupby(_POSE)["outside_range"].first().mean()
            rows.append(row | {"covered": _covered(part), "outside": float(outside)})
    return pd.DataFrame(rows)


def cost_table(
    timings: Mapping[tuple[str, ...], Mapping[str, float]], folds: Mapping[tuple[str, str], int], methods: Mapping[str, Method]
) -> pd.DataFrame:
    """What each method costs; one that builds on a diagnosis bears its cost too.

    `timings`: by data set, split and method, and of the diagnoses by data set and split: ``cpu_time``, seconds of a core, and
    ``max_rss``, MB at most, for all folds. `folds`: of a data set and split. Returns ``data, split, method, seconds_per_fold,
    memory_MB``; tuning of a method included.
    """
    rows = []
    for data, split, method in (key for key in timings if len(key) == 3):
        parts = [timings[data, split, method]] + [timings[data, split]] * (methods[method].physics == DIAGNOSIS)
        seconds = sum(part["cpu_time"] for part in parts) / folds[data, split]
        row = {"data": data, "split": split, "method": method, "seconds_per_fold": seconds}
        rows.append(row | {"memory_MB": max(part["max_rss"] for part in parts)})
    return pd.DataFrame(rows)


def mechanism_table(found: Mapping[str, pd.DataFrame], robots: Mapping[str, Sequence[str]], folds: int) -> pd.DataFrame:
    """Mechanisms of each data set over the diagnoses of its folds.

    `found`: rows of the mechanisms table of the random split, by data set. `robots`: data sets by the names of their robots.
    Returns ``robot, data, mechanism``, and of ``probability`` and ``share`` the mean over folds, the least and the largest. A
    fold that does not list a mechanism counts as probability and share 0.
    """
    rows = []
    for robot, data in ((robot, data) for robot, names in robots.items() for data in names):
        for mechanism, part in found[data].groupby("mechanism", sort=True):
            row = {"robot": robot, "data": data, "mechanism": mechanism}
            for name in ("probability", "share"):
                values = np.zeros(folds)
                values[: len(part)] = part[name]
                row |= {name: values.mean(), f"{name}_low": values.min(), f"{name}_high": values.max()}
            rows.append(row)
    return pd.DataFrame(rows)


def _errors(entries: pd.DataFrame) -> Errors:
    distance = np.linalg.norm(entries[["dx", "dy", "dz"]].to_numpy(), axis=1)
    return Errors(distance, groups_of(entries[_POSE].to_numpy())[1])


def _covered(entries: pd.DataFrame) -> float:
    off, stated = np.abs(entries[["dx", "dy", "dz"]].to_numpy()), entries[["std_x", "std_y", "std_z"]].to_numpy()
    return float((off < NORMAL_WIDTH * stated).mean()) if np.isfinite(stated).all() else float("nan")
