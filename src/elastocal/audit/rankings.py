"""Strategies by every metric and in pairs, followed back: strategy_scores.csv and strategy_pairs.csv, by pandas and scipy.

All strategies see the same data sets, so that of the ratio of two scores the logarithm deviates, data set by data set, by the
difference of their relative deviations: its standard error is that of the mean of these differences.
"""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import stats

if TYPE_CHECKING:
    from elastocal.audit.audited import Audited

# Of a normal distribution: 95 % within.
_QUANTILE = 1.96
# Metrics of one data set by the columns of results/uses, and by which power of the mean of the column.
_OF_ONE_SET = {
    "rms_um": ("mean_square", 0.5),
    "mean_um": ("mean", 1.0),
    "p95_um": ("p95", 1.0),
    "iso_9283_um": ("iso_9283", 1.0),
    "path_rms_um": ("path_mean_square", 0.5),
    "path_max_um": ("path_max", 1.0),
}
# Metrics of the averaged model by the columns of results/metrics, with the factor to their units.
_AVERAGED = {
    "k_sigma_percent": ("k_sigma", 1.0),
    "k_sigma_percent_fixed_joints": ("k_sigma_fixed_joints", 1.0),
    "dev_um": ("deviation", 1e6),
}


def scored(run: Audited, robot: str) -> dict[str, dict[str, tuple[float, np.ndarray, float]]]:
    """Value, relative deviations and their share in the standard error, by metric and strategy.

    Returns the deviations are those of data sets, of which an error has one over the root of their number, or of replicates.
    """
    found: dict[str, dict[str, tuple[float, np.ndarray, float]]] = {}
    uses, length = run.table(f"results/uses/{robot}.parquet"), run.configuration["tables"]["length"]
    for key, strategy in run.strategies.items():
        name = strategy["name"]
        mine = uses[uses["strategy"] == name].set_index("data_set").sort_index()
        share = len(mine) ** -0.5
        for metric, (column, power) in _OF_ONE_SET.items():
            if mine[column].notna().all():
                mean = mine[column].mean()
                deviation = power * mine[column].sub(mean).div(mean).to_numpy()
                found.setdefault(metric, {})[name] = (1e6 * mean**power, deviation, share)
        pooled = mine["pooled_p95"].iloc[0]
        deviation = mine["pooled_p95_influence"].div(pooled).to_numpy()
        found.setdefault("pooled_p95_um", {})[name] = (1e6 * pooled, deviation, share)
        at = run.cell("metrics", robot, key).set_index("length").loc[length]
        drawn = run.cell("replicates", robot, key)
        drawn = drawn[drawn["length"] == length].sort_values("replicate")
        for metric, (column, factor) in _AVERAGED.items():
            deviation = drawn[column].div(at[column]).to_numpy() - 1
            found.setdefault(metric, {})[name] = (factor * at[column], deviation, 1.0)
    return found


def strategy_scores(run: Audited) -> pd.DataFrame:
    """Every strategy by every metric, its rank and its ratio to the classical one."""
    parts = []
    classical = run.strategies[run.configuration["tables"]["classical_strategy"]]["name"]
    for robot in run.reduced:
        for metric, by_strategy in scored(run, robot).items():
            rows = []
            for name, (value, deviation, share) in by_strategy.items():
                row: dict[str, Any] = {"robot": robot, "metric": metric, "strategy": name, "value": value}
                row["value_std_error"] = abs(value) * share * stats.tstd(deviation)
                rows.append(row | _named("ratio", _ratio(by_strategy[name], by_strategy[classical])))
            part = pd.DataFrame(rows)
            # Strategies that are one estimator agree to six digits, and share a rank.
            parts.append(part.assign(rank=part["value"].abs().map("{:.6g}".format).astype(float).rank(method="min")))
    return pd.concat(parts)


def strategy_pairs(run: Audited) -> pd.DataFrame:
    """Every two estimators by every metric and by the RMS error of one data set."""
    rows: list[dict[str, Any]] = []
    for robot in run.reduced:
        found = scored(run, robot)
        by_rms = found["rms_um"]
        names = pd.Series({name: f"{score[0]:.6g}" for name, score in by_rms.items()}).drop_duplicates().index
        for metric, by_strategy in found.items():
            for one, other in combinations(names, 2):
                ratio, rms = (_ratio(scores[one], scores[other]) for scores in (by_strategy, by_rms))
                row: dict[str, Any] = {"robot": robot, "metric": metric, "strategy": one, "other": other}
                row |= _named("ratio", ratio) | _named("rms_ratio", rms)
                opposite = (ratio[1] > 1 and rms[2] < 1) or (ratio[2] < 1 and rms[1] > 1)
                rows.append(row | {"reversed": opposite})
    return pd.DataFrame(rows)


def _ratio(ours: tuple[float, np.ndarray, float], theirs: tuple[float, np.ndarray, float]) -> tuple[float, float, float]:
    """Ratio of two scores with its 95 % interval."""
    ratio, error = ours[0] / theirs[0], ours[2] * stats.tstd(ours[1] - theirs[1])
    return ratio, ratio * np.exp(-_QUANTILE * error), ratio * np.exp(_QUANTILE * error)


def _named(name: str, ratio: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip((name, f"{name}_low", f"{name}_high"), ratio, strict=True))
