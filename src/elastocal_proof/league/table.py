"""The table of the league: errors of every method on poses that it has not seen, with intervals, and what they cost."""

from __future__ import annotations

from dataclasses import dataclass
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

_REPLICATES = 1000
_AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Result:
    """Entries of one method on one data set and split.

    `entries`: rows of the entries table.
    """

    data: str
    split: str
    method: str
    entries: pd.DataFrame


def league_table(results: Sequence[Result], robots: Mapping[str, Sequence[str]], reference: str, seed: int) -> pd.DataFrame:
    """One row for each data set, split and method.

    `results`: all methods of a data set and split predict the same poses. `robots`: data sets by the names of their robots.
    `reference`: method whose RMS the others' are divided by. `seed`: of the bootstrap over poses. Returns ``robot, data, split,
    method, poses``; ``rms_mm`` with 95 % limits over poses, ``p95_mm``, ``max_mm`` and the share of all poses that stay below
    it at 95 % confidence; ``ratio``, the RMS over that of the reference on the same poses, with 95 % limits; ``ratio_to_best``
    the same over the best of the row's data set and split; ``covered``, the share of coordinates inside the 95 % intervals that
    the method states; ``outside``, the share of poses outside the range of the training poses.
    """
    robot_of = {data: robot for robot, names in robots.items() for data in names}
    rows: list[dict[str, Any]] = []
    for data, split in dict.fromkeys((result.data, result.split) for result in results):
        mine = [result for result in results if (result.data, result.split) == (data, split)]
        errors = [_errors(result.entries) for result in mine]
        first = next(number for number, result in enumerate(mine) if result.method == reference)
        limits, reductions = intervals(errors, _REPLICATES, stream(seed, data, f"league {split}", 0), first)
        rms = np.array([summary(error.distance)["rms_m"] for error in errors])
        best = int(np.argmin(rms))
        to_best = intervals(errors, _REPLICATES, stream(seed, data, f"league {split}", 1), best)[1]
        for number, (result, error, limit) in enumerate(zip(mine, errors, limits, strict=True)):
            figures = summary(error.distance)
            row: dict[str, Any] = {"robot": robot_of[data], "data": data, "split": split, "method": result.method}
            row |= {"poses": error.poses, "rms_mm": 1e3 * rms[number]}
            row |= {"rms_low_mm": 1e3 * limit["rms_m"][0], "rms_high_mm": 1e3 * limit["rms_m"][1]}
            row |= {"p95_mm": 1e3 * figures["p95_m"], "max_mm": 1e3 * figures["max_m"]}
            row |= {"share_below_max": share_below_largest(error.poses), "ratio": rms[number] / rms[first]}
            row |= {"ratio_low": 1.0 - reductions[number].high, "ratio_high": 1.0 - reductions[number].low}
            row |= {"ratio_to_best": rms[number] / rms[best]}
            row |= {"ratio_to_best_low": 1.0 - to_best[number].high, "ratio_to_best_high": 1.0 - to_best[number].low}
            rows.append(row | {"covered": _covered(result.entries), "outside": _outside(result.entries)})
    return pd.DataFrame(rows)


def cost_table(
    timings: Mapping[tuple[str, str, str], Mapping[str, float]],
    diagnosed: Mapping[tuple[str, str], Mapping[str, float]],
    folds: Mapping[tuple[str, str], int],
    methods: Mapping[str, Method],
) -> pd.DataFrame:
    """What each method costs; one that builds on a diagnosis bears its cost too.

    `timings` (str, str, str): by data set, split and method: ``seconds`` of a core and ``memory_MB`` at most, for all folds.
    `diagnosed` (str, str): the same of the diagnoses, by data set and split. `folds` (str, str): folds of a data set and split.
    Returns ``data, split, method, seconds_per_fold, memory_MB``; tuning of a method included.
    """
    rows = []
    for (data, split, method), own in timings.items():
        parts = [own, diagnosed[data, split]] if methods[method].physics == DIAGNOSIS else [own]
        seconds = sum(part["seconds"] for part in parts) / folds[data, split]
        memory = max(part["memory_MB"] for part in parts)
        rows.append({"data": data, "split": split, "method": method, "seconds_per_fold": seconds, "memory_MB": memory})
    return pd.DataFrame(rows)


def mechanism_table(found: Mapping[str, pd.DataFrame], robots: Mapping[str, Sequence[str]], folds: int) -> pd.DataFrame:
    """Mechanisms of each data set over the diagnoses of its folds.

    `found`: rows of the mechanisms table of the random split, by data set. `robots`: data sets by the names of their robots.
    Returns ``robot, data, mechanism``, and of ``probability`` and ``share`` the mean over folds, the least and the largest. A
    fold that does not list a mechanism counts as probability and share 0.
    """
    rows = []
    for robot, names in robots.items():
        for data in names:
            for mechanism, part in found[data].groupby("mechanism", sort=True):
                row = {"robot": robot, "data": data, "mechanism": mechanism}
                for name in ("probability", "share"):
                    values = np.zeros(folds)
                    values[: len(part)] = part[name]
                    row |= {name: values.mean(), f"{name}_low": values.min(), f"{name}_high": values.max()}
                rows.append(row)
    return pd.DataFrame(rows)


def _errors(entries: pd.DataFrame) -> Errors:
    pose = groups_of(entries[["set", "session", "pose"]].to_numpy())[1]
    return Errors(np.linalg.norm(entries[[f"d{axis}" for axis in _AXES]].to_numpy(), axis=1), pose)


def _covered(entries: pd.DataFrame) -> float:
    off = np.abs(entries[[f"d{axis}" for axis in _AXES]].to_numpy())
    stated = entries[[f"std_{axis}" for axis in _AXES]].to_numpy()
    return float((off < NORMAL_WIDTH * stated).mean()) if np.isfinite(stated).all() else float("nan")


def _outside(entries: pd.DataFrame) -> float:
    poses = entries.groupby(["set", "session", "pose"])["outside_range"].first()
    return float(poses.mean())
