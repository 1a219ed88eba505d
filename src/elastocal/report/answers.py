"""Every number that the text of the report states, from the tables, already worded with its standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elastocal.study.printed import LEVEL
from elastocal.study.tables import column_head, deviation_ratio, merge_errors, word_value

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import pandas as pd

# The repeatability that the paper names for both robots, in µm.
REPEATABILITY_UM = 60.0


def answers(
    comparison: pd.DataFrame,
    expectations: pd.DataFrame,
    table2: pd.DataFrame,
    per_dataset: pd.DataFrame,
    extended: pd.DataFrame,
    solvers: pd.DataFrame,
    metrics: pd.DataFrame,
    replicates: pd.DataFrame,
    noisiest: pd.DataFrame,
    titles: Mapping[str, str],
    cells: Mapping[str, Any],
) -> dict[str, Any]:
    """Facts for the report.

    `comparison`, `expectations`, `table2`, `per_dataset`, `extended`, `solvers`: tables of the study. `metrics`, `replicates`:
    long, at the noise level of the tables. `noisiest`: long metrics at the largest noise level. `titles`: names of the robots
    without links, by their keys. `cells`: noise_um, length and classical_strategy (a name) of the tables. Returns
    JSON-serialisable; strings ready to print, lists for tables.
    """
    noise_um, length, classical = cells["noise_um"], cells["length"], cells["classical_strategy"]
    judged = comparison[comparison.p_value.notna()]
    at = metrics[metrics.length == length]
    single = per_dataset[(per_dataset.noise_um == noise_um)]
    return {
        "noise_um": f"{noise_um:g}",
        "length": str(length),
        "classical": classical,
        "repeatability_um": f"{REPEATABILITY_UM:g}",
        "level": f"{100 * LEVEL:g}",
        "studies": str(int(expectations.studies.max())) if len(expectations) else "0",
        "cells": str(len(judged)),
        "differ": str(int((judged.p_holm < LEVEL).sum())),
        "below": str(int((judged.p_value < LEVEL).sum())),
        "below_expected": f"{LEVEL * len(judged):.1f}",
        "by_table": [_count(judged, table) for table in ("2", "3", "4")],
        "outside": [_outside_row(row) for row in judged[judged.p_value < LEVEL].itertuples()],
        "expectations": _expectation_rows(expectations),
        "text_figures": [_text_row(row) for row in comparison[comparison.table == "text"].itertuples()],
        "one_set": _one_set_rows(comparison, table2),
        "robots": [
            _robot_facts(robot, title, at, single, metrics, replicates, cells, noisiest) for robot, title in titles.items()
        ],
        "extended": merge_errors(extended.drop(columns="robot")).to_dict("records"),
        "solvers": [
            {
                "robot": row.robot,
                "strategy": row.strategy,
                "closest": row.closest_strategy,
                "equation_11": f"{row.equation_11_difference:.0e}",
                "gauss_newton": f"{row.gauss_newton_difference:.0e}",
                "between": f"{row.between_solvers:.0e}",
            }
            for row in solvers.itertuples()
        ],
    }


def _count(judged: pd.DataFrame, table: str) -> dict[str, str]:
    mine = judged[judged.table == table]
    return {"table": table, "cells": str(len(mine)), "differ": str(int((mine.p_holm < LEVEL).sum()))}


def _outside_row(row: Any) -> dict[str, str]:
    return {
        "figure": f"Table {row.table}: {column_head(row.quantity)}",
        "robot": row.robot,
        "strategy": row.strategy if isinstance(row.strategy, str) else "",
        "paper": f"{row.paper:g}",
        "studies": word_value(row.studies_mean, row.studies_std),
        "p": f"{row.p_value:.2g}",
        "holm": f"{row.p_holm:.2g}",
    }


def _expectation_rows(expectations: pd.DataFrame) -> list[dict[str, str]]:
    """Expectation, studies and the paper, where the paper prints a figure."""
    return [_expectation_row(row) for row in expectations[expectations.paper.notna()].itertuples()]


def _expectation_row(row: Any) -> dict[str, str]:
    return {
        "robot": row.robot,
        "strategy": row.strategy,
        "quantity": column_head(row.quantity),
        "expected": f"{row.expected:.2f}",
        "studies": f"{row.studies_mean:.2f} ± {row.studies_std:.2f}",
        "paper": f"{row.paper:.3f}",
        "p": f"{row.p_value:.2g}",
    }


def _text_row(row: Any) -> dict[str, str]:
    shown = "not studied" if np.isnan(row.ours) else word_value(row.ours, row.mc_std)
    interpretation = row.interpretation if isinstance(row.interpretation, str) else ""
    return {
        "figure": column_head(row.quantity),
        "paper": f"{row.paper:g}",
        "ours": shown,
        "interpretation": interpretation,
    }


def _one_set_rows(comparison: pd.DataFrame, table2: pd.DataFrame) -> list[dict[str, str]]:
    """The paper's Table 2 against the statistics of single data sets."""
    rows = []
    columns = {"deviation_mean": "mean_mm", "deviation_std": "std_mm", "deviation_max": "max_mm"}
    figure: Any
    for figure in comparison[comparison.table == "2"].itertuples():
        found = table2[table2.robot == figure.robot]
        if len(found):
            column = columns[figure.quantity]
            one, spread = float(found[f"{column}_one_set"].iloc[0]), float(found[f"{column}_one_set_std"].iloc[0])
            everything = f"{float(found[column].iloc[0]):.3f}"
            rows.append(
                {
                    "robot": figure.robot,
                    "quantity": figure.quantity.replace("deviation_", ""),
                    "paper": f"{figure.paper:.3f}",
                    "all": everything,
                    "one": f"{one:.2f} ± {spread:.2f}",
                    "p": "fitted" if np.isnan(figure.p_value) else f"{figure.p_value:.2f}",
                }
            )
    return rows


def _robot_facts(
    robot: str,
    title: str,
    at: pd.DataFrame,
    single: pd.DataFrame,
    metrics: pd.DataFrame,
    replicates: pd.DataFrame,
    cells: Mapping[str, Any],
    noisiest: pd.DataFrame,
) -> dict[str, str]:
    noise_um, length, classical = cells["noise_um"], cells["length"], cells["classical_strategy"]
    averaged = at[at.robot == robot].set_index("strategy")
    # Strategies that are the same estimator differ by rounding; the first one listed speaks for them.
    best = str(averaged.deviation.round(12).idxmin())
    worst = str(averaged.deviation.idxmax())
    ratio = deviation_ratio(metrics, replicates, robot, classical, best, noise_um, length)
    own = single[single.robot == robot]
    here = own[own.ds == length].set_index("strategy")
    noisy = noisiest[(noisiest.robot == robot) & (noisiest.length == length)]
    share = 100 * (1 - averaged.deviation / averaged.initial_deviation)
    return {
        "title": title,
        "best": best,
        "worst": worst,
        "dev_classical": word_value(1e6 * averaged.deviation[classical], 1e6 * averaged.deviation_std_error[classical]),
        "dev_best": word_value(1e6 * averaged.deviation[best], 1e6 * averaged.deviation_std_error[best]),
        "dev_worst": word_value(1e6 * averaged.deviation[worst], 1e6 * averaged.deviation_std_error[worst]),
        "ratio": word_value(*ratio),
        "share": f"{share[classical]:.1f}",
        "single_classical": word_value(here.mean_um[classical], here.mean_um_std_error[classical]),
        "single_best": word_value(here.mean_um[best], here.mean_um_std_error[best]),
        "p95_classical": word_value(here.p95_um[classical], here.p95_um_std_error[classical]),
        "p95_best": word_value(here.p95_um[best], here.p95_um_std_error[best]),
        "hidden": f"{here.mean_um[classical] / (1e6 * averaged.deviation[classical]):.1f}",
        "efficiency_best": word_value(100 * here.efficiency[best], 100 * here.efficiency_std_error[best]),
        "efficiency_worst": word_value(100 * here.efficiency.min(), 100 * here.efficiency_std_error[here.efficiency.idxmin()]),
        "lowest_efficiency": str(here.efficiency.idxmin()),
        "repeatable_classical": _length_for(own, classical),
        "repeatable_best": _length_for(own, best),
        "noisiest_um": f"{noisiest.noise_um.max():g}",
        "noisiest_nonpositive": f"{100 * noisy.nonpositive_share.max():.1f}",
        "noisiest_spread": f"{100 * noisy.relative_spread.max():.0f}",
    }


def _length_for(own: pd.DataFrame, strategy: str) -> str:
    """Fewest configurations, of the lengths evaluated, whose RMS error is within the repeatability."""
    cell = own[(own.strategy == strategy) & (own.rms_um <= REPEATABILITY_UM)]
    return str(int(cell.ds.min())) if len(cell) else "more than all"
