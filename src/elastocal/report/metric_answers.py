"""What the report says about metrics that judge strategies (RQ4), already worded."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elastocal.report.answers import ratio_words, with_error
from elastocal.study.uses import REFERENCE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd

# In the order in which they are shown.
METRIC_NAMES = {
    REFERENCE: "RMS of one data set",
    "mean_um": "mean of one data set",
    "p95_um": "p95 of one data set",
    "pooled_p95_um": "p95 pooled over data sets",
    "iso_9283_um": "largest at the ISO 9283 poses",
    "path_rms_um": "RMS on a milling path",
    "path_max_um": "largest on a milling path",
    "dev_um": "dev (equation 15)",
    "k_sigma_percent": "k_Σ of all joints",
    "k_sigma_percent_fixed_joints": "k_Σ of the fixed joints",
}


def score_rows(scores: pd.DataFrame, robots: Iterable[str]) -> list[dict[str, str]]:
    """Every metric of every strategy with its rank.

    `scores`: from `ranks.ranks_table`. Returns robot, strategy, and for each of `METRIC_NAMES` the score and, in brackets, its
    rank; a dash where the robot does not reach what it is used for.
    """
    rows = []
    for robot in robots:
        mine = scores[scores.robot == robot]
        for strategy in dict.fromkeys(mine.strategy):
            cells = mine[mine.strategy == strategy].set_index("metric")
            row = {"robot": robot, "strategy": strategy}
            for metric in METRIC_NAMES:
                row[metric] = "–"
                if metric in cells.index:
                    cell = cells.loc[metric]
                    row[metric] = f"{with_error(cell, 'value')} ({cell['rank']})"
            rows.append(row)
    return rows


def staged_rows(scores: pd.DataFrame, robots: Iterable[str]) -> list[dict[str, str]]:
    """RMS error of each strategy over that of the classical one, paired by data set.

    `scores`, `robots`: as in `score_rows`. Returns strategy, and for each robot the ratio with its interval.
    """
    mine = scores[scores.metric == REFERENCE]
    rows = []
    for strategy in dict.fromkeys(mine.strategy):
        row = {"strategy": strategy}
        for robot in robots:
            cell = mine[(mine.robot == robot) & (mine.strategy == strategy)].iloc[0]
            # An estimator under another name, and the classical strategy itself.
            row[robot] = "the same" if cell.ratio_low == cell.ratio_high else ratio_words(cell)
        rows.append(row)
    return rows


def metric_summary(pairs: pd.DataFrame, titles: Mapping[str, str]) -> dict[str, str]:
    """How often metrics put two estimators in the other order than the RMS error of one data set does.

    `pairs`: from `ranks.pairs_table`. `titles`: names of robots by their keys. Returns pairs: of different estimators;
    reversed_by: metrics that reverse some, with how many; never: metrics that reverse none; example: the most reversed pair.
    """
    counts = {
        name: int(pairs.reversed[pairs.metric == name].sum()) for name in METRIC_NAMES if name in {*pairs.metric} - {REFERENCE}
    }
    worst = pairs[pairs.reversed].assign(size=lambda frame: (frame.ratio / frame.rms_ratio).abs())
    example = ""
    if len(worst):
        row = worst.iloc[int(worst["size"].argmax())]
        example = (
            f"{METRIC_NAMES[row.metric]} of {row.strategy} on {titles[row.robot]} is {row.ratio:.2f} times "
            f"({row.ratio_low:.2f} to {row.ratio_high:.2f}) that of {row.other}, its RMS {row.rms_ratio:.2f} times "
            f"({row.rms_ratio_low:.2f} to {row.rms_ratio_high:.2f})"
        )
    return {
        "pairs": str(int((pairs.metric == REFERENCE).sum())),
        "reversed_by": ", ".join(f"{METRIC_NAMES[name]} ({number})" for name, number in counts.items() if number) or "none",
        "never": ", ".join(METRIC_NAMES[name] for name, number in counts.items() if not number),
        "example": example,
    }
