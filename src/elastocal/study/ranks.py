"""Where metrics rank strategies differently (RQ4), with paired intervals.

All strategies see the same data sets, so that their scores go up and down together: what counts is the ratio of two of them,
data set by data set. For a score that is a smooth function of means over data sets its influence values give the variance of
the logarithm of a ratio (delta method [1]; of a quantile by Bahadur's representation); the paper's scores of averaged models
have the bootstrap replicates, whose weights all strategies share.

[1] van der Vaart, A. W., Asymptotic Statistics, chapters 3 and 21, Cambridge University Press, 1998.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from elastocal.study.budget_tables import MICRO, QUANTILE

REFERENCE = "rms_um"
# Scores of strategies that are one estimator agree to rounding.
_DIGITS = 6
# Scores of averaged models, with the factor to their units.
_AVERAGED = {"k_sigma_percent": ("k_sigma", 1.0), "k_sigma_percent_fixed_joints": ("k_sigma_fixed_joints", 1.0)}
_AVERAGED |= {"dev_um": ("deviation", MICRO)}


@dataclass(frozen=True)
class Score:
    """A score of one strategy.

    `relative` (N,): deviations of its logarithm, of data sets or replicates that all strategies share. `spread`: the standard
    error over the standard deviation of `relative`: 1 over the root of N for data sets, 1 for replicates.
    """

    value: float
    relative: np.ndarray
    spread: float

    def std_error(self) -> float:
        """Standard error of the value."""
        return float(abs(self.value) * self.spread * self.relative.std(ddof=1))

    def ratio(self, other: Score) -> tuple[float, float, float]:
        """Ratio to another strategy's score with its 95 % interval, paired."""
        ratio = self.value / other.value
        error = QUANTILE * self.spread * (self.relative - other.relative).std(ddof=1)
        return ratio, ratio * np.exp(-error), ratio * np.exp(error)


def scores(uses: pd.DataFrame, metrics: pd.DataFrame, replicates: pd.DataFrame, length: int) -> dict[str, dict[str, Score]]:
    """Scores of one robot's strategies by every metric.

    `uses`: the uses table. `metrics`, `replicates`: long, of the robot at the noise of the tables. Returns metric, strategy;
    without metrics at places that the robot does not reach.
    """
    found: dict[str, dict[str, Score]] = {}
    for strategy in dict.fromkeys(uses.strategy):
        mine = uses[uses.strategy == strategy].sort_values("data_set")
        for name, score in _of_single_sets(mine).items():
            found.setdefault(name, {})[strategy] = score
        at = metrics[(metrics.strategy == strategy) & (metrics.length == length)]
        drawn = replicates[(replicates.strategy == strategy) & (replicates.length == length)].sort_values("replicate")
        for name, (column, factor) in _AVERAGED.items():
            value = float(at[column].iloc[0])
            relative = drawn[column].to_numpy() / value - 1
            found.setdefault(name, {})[strategy] = Score(factor * value, relative, 1.0)
    return found


def ranks_table(found: Mapping[str, Mapping[str, Mapping[str, Score]]], classical: str) -> pd.DataFrame:
    """Every strategy by every metric, its rank, and its ratio to the classical strategy.

    `found`: `scores` of each robot. `classical`: name of a strategy. Returns robot, metric, strategy, value, value_std_error,
    ratio with its 95 % interval (ratio_low, ratio_high), rank from 1; one estimator under two names has one rank.
    """
    from scipy.stats import rankdata

    rows = []
    for robot, by_metric in found.items():
        for metric, by_strategy in by_metric.items():
            values = np.array([score.value for score in by_strategy.values()])
            places = rankdata(_round(np.abs(values)), method="min")
            for (strategy, score), rank in zip(by_strategy.items(), places, strict=True):
                ratio, low, high = score.ratio(by_strategy[classical])
                rows.append(
                    {
                        "robot": robot,
                        "metric": metric,
                        "strategy": strategy,
                        "value": score.value,
                        "value_std_error": score.std_error(),
                        "ratio": ratio,
                        "ratio_low": low,
                        "ratio_high": high,
                        "rank": int(rank),
                    }
                )
    return pd.DataFrame(rows)


def pairs_table(found: Mapping[str, Mapping[str, Mapping[str, Score]]]) -> pd.DataFrame:
    """Every two different estimators by every metric and by the RMS error of one data set.

    `found`: as in `ranks_table`. Returns robot, metric, strategy, other, ratio, ratio_low, ratio_high, rms_ratio,
    rms_ratio_low, rms_ratio_high, and reversed: both intervals exclude one, on opposite sides.
    """
    rows = []
    for robot, by_metric in found.items():
        reference = by_metric[REFERENCE]
        names = _find_distinct(reference)
        for metric, by_strategy in by_metric.items():
            for index, strategy in enumerate(names):
                for other in names[index + 1 :]:
                    ratio, by_rms = (some[strategy].ratio(some[other]) for some in (by_strategy, reference))
                    sides = [int(low > 1) - int(high < 1) for _, low, high in (ratio, by_rms)]
                    row: dict[str, Any] = {"robot": robot, "metric": metric, "strategy": strategy, "other": other}
                    row |= dict(zip(("ratio", "ratio_low", "ratio_high"), ratio, strict=True))
                    row |= dict(zip(("rms_ratio", "rms_ratio_low", "rms_ratio_high"), by_rms, strict=True))
                    rows.append(row | {"reversed": sides[0] * sides[1] < 0})
    return pd.DataFrame(rows)


def _of_single_sets(mine: pd.DataFrame) -> dict[str, Score]:
    count = len(mine)
    found = {}
    for name, column, root in (
        (REFERENCE, "mean_square", True),
        ("mean_um", "mean", False),
        ("p95_um", "p95", False),
        ("iso_9283_um", "iso_9283", False),
        ("path_rms_um", "path_mean_square", True),
        ("path_max_um", "path_max", False),
    ):
        values = mine[column].to_numpy()
        if np.isnan(values).any():
            continue
        mean = values.mean()
        # The logarithm of a root deviates half as much as that of the mean below it.
        relative = (values / mean - 1) / (2 if root else 1)
        found[name] = Score(MICRO * float(np.sqrt(mean) if root else mean), relative, 1 / np.sqrt(count))
    pooled = float(mine.pooled_p95.iloc[0])
    found["pooled_p95_um"] = Score(MICRO * pooled, mine.pooled_p95_influence.to_numpy() / pooled, 1 / np.sqrt(count))
    return found


def _round(values: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.{_DIGITS}g}") for value in values])


def _find_distinct(by_strategy: Mapping[str, Score]) -> Sequence[str]:
    """The first name of each estimator."""
    seen: dict[float, str] = {}
    for strategy, score in by_strategy.items():
        seen.setdefault(float(_round(np.array([score.value]))[0]), strategy)
    return [*seen.values()]
