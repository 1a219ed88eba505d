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
_EXPECTATIONS = {
    "robot": "{robot}",
    "strategy": "{strategy}",
    "quantity": "{head}",
    "expected": "{expected:.2f}",
    "studies": "{studies_mean:.2f} ± {studies_std:.2f}",
    "paper": "{paper:.3f}",
    "p": "{p_value:.2g}",
}
_SOLVERS = {
    "robot": "{robot}",
    "strategy": "{strategy}",
    "closest": "{closest_strategy}",
    "equation_11": "{equation_11_difference:.0e}",
    "gauss_newton": "{gauss_newton_difference:.0e}",
    "between": "{between_solvers:.0e}",
}
# The paper's Table 2 in that of the study.
_DEVIATIONS = {"deviation_mean": "mean_mm", "deviation_std": "std_mm", "deviation_max": "max_mm"}


def worded(frame: pd.DataFrame, forms: Mapping[str, str]) -> list[dict[str, str]]:
    """Rows of a table in words: under each name its form, filled in with the columns of the row."""
    return [{name: form.format_map(row) for name, form in forms.items()} for row in frame.to_dict("records")]


def with_error(row: Any, name: str) -> str:
    """A value of a row with its standard error."""
    return word_value(row[name], row[f"{name}_std_error"])


def ratio_words(row: Any, name: str = "ratio", digits: int = 3) -> str:
    """A ratio of a row with its interval."""
    value, low, high = (f"{row[name + end]:.{digits}f}" for end in ("", "_low", "_high"))
    return f"{value} ({low} to {high})"


def answers(tables: Mapping[str, pd.DataFrame], titles: Mapping[str, str], cells: Mapping[str, Any]) -> dict[str, Any]:
    """Facts for the report.

    `tables`: comparison, expectations, table2, per_dataset, extended and solvers of the study; metrics and replicates, long, at
    the noise level of the tables; noisiest, long metrics at the largest one. `titles`: names of the robots without links, by
    their keys. `cells`: noise_um, length and classical_strategy (a name) of the tables. Returns JSON-serialisable; strings
    ready to print, lists for tables.
    """
    comparison, expectations = tables["comparison"], tables["expectations"]
    judged = comparison[comparison.p_value.notna()]
    below = judged[judged.p_value < LEVEL]
    printed = expectations[expectations.paper.notna()]
    return {
        "noise_um": f"{cells['noise_um']:g}",
        "length": str(cells["length"]),
        "classical": cells["classical_strategy"],
        "repeatability_um": f"{REPEATABILITY_UM:g}",
        "level": f"{100 * LEVEL:g}",
        "studies": str(int(expectations.studies.max())) if len(expectations) else "0",
        **_count(judged),
        "below": str(len(below)),
        "below_expected": f"{LEVEL * len(judged):.1f}",
        "by_table": [{"table": table} | _count(judged[judged.table == table]) for table in ("2", "3", "4")],
        "outside": [_outside_row(row) for row in below.itertuples()],
        "expectations": worded(printed.assign(head=printed.quantity.map(column_head)), _EXPECTATIONS),
        "text_figures": [_text_row(row) for row in comparison[comparison.table == "text"].itertuples()],
        "one_set": _one_set_rows(comparison, tables["table2"]),
        "robots": [_robot_facts(tables, robot, title, cells) for robot, title in titles.items()],
        "extended": merge_errors(tables["extended"].drop(columns="robot")).to_dict("records"),
        "solvers": worded(tables["solvers"], _SOLVERS),
    }


def beside_rows(beside: pd.DataFrame, titles: Mapping[str, str]) -> list[dict[str, str]]:
    """Each figure that the paper prints beside ours, in words.

    `beside`: by `comparison.beside_paper`. `titles`: names of the robots by their keys. Of ours stands the Monte Carlo standard
    deviation of a study of this size behind ±; `differs` says by how many of these the two differ.
    """
    return [_beside_row(row, titles) for row in beside.itertuples()]


def _beside_row(row: Any, titles: Mapping[str, str]) -> dict[str, str]:
    return {
        "table": row.table,
        "robot": titles.get(row.robot, ""),
        "strategy": row.strategy if isinstance(row.strategy, str) else "",
        "quantity": column_head(row.quantity),
        "paper": f"{row.paper:g}",
        "ours": "not studied" if np.isnan(row.ours) else word_value(row.ours, row.mc_std),
        "differs": "" if np.isnan(row.z) else f"{row.z:+.1f}",
    }


def _count(judged: pd.DataFrame) -> dict[str, str]:
    return {"cells": str(len(judged)), "differ": str(int((judged.p_holm < LEVEL).sum()))}


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


def _text_row(row: Any) -> dict[str, str]:
    return {
        "figure": column_head(row.quantity),
        "paper": f"{row.paper:g}",
        "ours": "not studied" if np.isnan(row.ours) else word_value(row.ours, row.mc_std),
        "interpretation": row.interpretation if isinstance(row.interpretation, str) else "",
    }


def _one_set_rows(comparison: pd.DataFrame, table2: pd.DataFrame) -> list[dict[str, str]]:
    """The paper's Table 2 against the statistics of single data sets."""
    studied, rows = table2.set_index("robot"), []
    figure: Any
    for figure in comparison[(comparison.table == "2") & comparison.robot.isin(table2.robot)].itertuples():
        found, column = studied.loc[figure.robot], _DEVIATIONS[figure.quantity]
        rows.append(
            {
                "robot": figure.robot,
                "quantity": figure.quantity.removeprefix("deviation_"),
                "paper": f"{figure.paper:.3f}",
                "all": f"{found[column]:.3f}",
                "one": f"{found[f'{column}_one_set']:.2f} ± {found[f'{column}_one_set_std']:.2f}",
                "p": "fitted" if np.isnan(figure.p_value) else f"{figure.p_value:.2f}",
            }
        )
    return rows


def _robot_facts(tables: Mapping[str, pd.DataFrame], robot: str, title: str, cells: Mapping[str, Any]) -> dict[str, str]:
    noise_um, length, classical = cells["noise_um"], cells["length"], cells["classical_strategy"]
    metrics, single, noisiest = (tables[name][tables[name].robot == robot] for name in ("metrics", "per_dataset", "noisiest"))
    averaged = metrics[metrics.length == length].set_index("strategy")
    # Strategies that are the same estimator differ by rounding; the first one listed speaks for them.
    best, worst = str(averaged.deviation.round(12).idxmin()), str(averaged.deviation.idxmax())
    own = single[single.noise_um == noise_um]
    here = own[own.ds == length].set_index("strategy")
    lowest = str(here.efficiency.idxmin())
    noisy = noisiest[noisiest.length == length]
    share = 100 * (1 - averaged.deviation / averaged.initial_deviation)

    def stated(frame: pd.DataFrame, strategy: str, name: str, factor: float = 1.0) -> str:
        return word_value(factor * frame[name][strategy], factor * frame[f"{name}_std_error"][strategy])

    return {
        "title": title,
        "best": best,
        "worst": worst,
        "dev_classical": stated(averaged, classical, "deviation", 1e6),
        "dev_best": stated(averaged, best, "deviation", 1e6),
        "dev_worst": stated(averaged, worst, "deviation", 1e6),
        "ratio": word_value(*deviation_ratio(metrics, tables["replicates"], robot, classical, best, noise_um, length)),
        "share": f"{share[classical]:.1f}",
        "single_classical": stated(here, classical, "mean_um"),
        "single_best": stated(here, best, "mean_um"),
        "p95_classical": stated(here, classical, "p95_um"),
        "p95_best": stated(here, best, "p95_um"),
        "hidden": f"{here.mean_um[classical] / (1e6 * averaged.deviation[classical]):.1f}",
        "efficiency_best": stated(here, best, "efficiency", 100),
        "efficiency_worst": stated(here, lowest, "efficiency", 100),
        "lowest_efficiency": lowest,
        "repeatable_classical": _length_for(own, classical),
        "repeatable_best": _length_for(own, best),
        "noisiest_um": f"{tables['noisiest'].noise_um.max():g}",
        "noisiest_nonpositive": f"{100 * noisy.nonpositive_share.max():.1f}",
        "noisiest_spread": f"{100 * noisy.relative_spread.max():.0f}",
    }


def _length_for(own: pd.DataFrame, strategy: str) -> str:
    """Fewest configurations, of the lengths evaluated, whose RMS error is within the repeatability."""
    cell = own[(own.strategy == strategy) & (own.rms_um <= REPEATABILITY_UM)]
    return str(int(cell.ds.min())) if len(cell) else "more than all"
