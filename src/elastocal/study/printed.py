"""The paper's printed figures next to ours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from elastocal.study.jobs import (
    Job,
    read_printed_figures,
    write_csvs,
)
from elastocal.study.tables import COMPLIANCE, Results, read_results

# Robot and quantity for which a parameter of the study was chosen.
FITTED = ("kuka_extended", "deviation_mean")
# Columns of Table 4 whose names differ from the printed quantity.
_TABLE4_COLUMNS = {"k_sigma_20": "k_sigma_20_percent", "dev_20": "dev_20_um"}
_HEADS = ["table", "robot", "strategy", "quantity", "unit"]
_NO_VALUE = (np.nan, np.nan)


@dataclass(frozen=True)
class OurResults:
    """The results with which a printed figure may be compared.

    Attributes
    ----------
    tables
        table1 .. table4 and extended.
    results
        Metrics of all robots and strategies.
    """

    tables: dict[str, pd.DataFrame]
    results: Results

    def get_cell(self, table: str, column: str, **keys: str) -> tuple[float, float]:
        """Value and standard error of one cell; NaN if the table lacks it."""
        rows = self.tables[table]
        for head, value in keys.items():
            rows = rows[rows[head] == value]
        if rows.empty or column not in rows:
            return _NO_VALUE
        errors = rows.get(f"{column}_std_error", pd.Series(0.0, rows.index))
        return float(rows[column].iloc[0]), float(errors.iloc[0])

    def look_up(self, figure: Any) -> tuple[tuple[float, float], str]:
        """Our value of a printed figure with its standard deviation, and its
        interpretation."""
        robot = figure.robot
        quantity = figure.quantity
        if figure.table == "text":
            return self._look_up_text(quantity)
        if figure.table == "1":
            column = COMPLIANCE.format(quantity[1:])
            value, _ = self.get_cell("table1", column, robot=robot)
            return (value, 0.0), "R1: an input"
        if figure.table == "2":
            fitted = (robot, quantity) == FITTED
            column = f"{quantity.removeprefix('deviation_')}_mm_one_set"
            value, _ = self.get_cell("table2", column, robot=robot)
            std, _ = self.get_cell("table2", f"{column}_std", robot=robot)
            reason = "R11: the tube was chosen for it" if fitted else "R3, R13"
            return (value, std), reason
        if figure.table == "3":
            column = COMPLIANCE.format(quantity[1:])
            return self.get_cell("table3", column, robot=robot), "R7"
        return self._look_up_table4(figure)

    def _look_up_table4(self, figure: Any) -> tuple[tuple[float, float], str]:
        column = _TABLE4_COLUMNS.get(figure.quantity, figure.quantity)
        keys = {"strategy": figure.strategy, "robot": figure.robot}
        all_joints = self.get_cell("table4", column, **keys)
        if "k_sigma" not in column:
            return all_joints, "R8"
        fixed_joints = self.get_cell("table4", f"{column}_fixed_joints", **keys)
        if fixed_joints == all_joints:
            return fixed_joints, "R7"
        return fixed_joints, "R7, R10: joints fixed in the last stage"

    def _look_up_text(self, quantity: str) -> tuple[tuple[float, float], str]:
        """Our value of a figure that the paper's text states."""
        if quantity == "residual_deviation_upper_bound":
            extended = self.tables["extended"]
            if extended.empty:
                return _NO_VALUE, ""
            worst = extended.iloc[extended.residual_mean_um.argmax()]
            cell = worst.residual_mean_um, worst.residual_mean_um_std_error
            return cell, "R11: largest of all strategies; the paper prints a bound"
        if quantity == "share_compensated_with_link_elasticity":
            column = "share_compensated_percent"
            cell = self.get_cell("extended", column, strategy="6DoF")
            return cell, "R11, strategy 6DoF"
        if quantity == "share_compensated_joint_elasticity_only":
            cell = self.results.compute_share_compensated("kuka", "6DoF")
            return cell, "kuka, strategy 6DoF"
        return self._find_smallest_ratio(), (
            "R8: the best strategy of each robot, the smaller robot ratio"
        )

    def _find_smallest_ratio(self) -> tuple[float, float]:
        """Smallest ratio, over the robots, of the deviation of 6DoF to that of the
        robot's best strategy."""
        column = f"dev_{self.results.length}_um"
        ratios = []
        for _, rows in self.tables["table4"].groupby("robot", sort=True):
            best = rows.iloc[rows[column].argmin()]
            ratio = self.results.compute_deviation_ratio(
                best.robot, "6DoF", best.strategy
            )
            ratios.append(ratio)
        return min(ratios)


def compare_figures(printed: pd.DataFrame, ours: OurResults) -> pd.DataFrame:
    """Compare each figure that the paper prints with ours.

    Parameters
    ----------
    printed
        As printed, with a value; empty strings for heads that a figure lacks.
    ours

    Returns
    -------
    DataFrame
        The heads, and paper, ours, mc_std (standard deviation between studies of this
        size, by bootstrap over data sets and test configurations; between data sets for
        Table 2), z = (ours - paper) / mc_std, interpretation. Values that the study does
        not cover are empty.
    """
    rows = []
    figure: Any
    for figure in printed.itertuples():
        (value, std), interpretation = ours.look_up(figure)
        z = np.nan
        if std > 0 and np.isfinite(value):
            z = (value - figure.value) / std
        heads = [getattr(figure, name) for name in _HEADS]
        rows.append((*heads, figure.value, value, std, z, interpretation))
    return pd.DataFrame(
        rows, columns=[*_HEADS, "paper", "ours", "mc_std", "z", "interpretation"]
    )


def compare_with_paper(job: Job) -> None:
    """Write every printed figure next to ours."""
    tables = {
        name: pd.read_csv(job.input[name])
        for name in ("table1", "table2", "table3", "table4", "extended")
    }
    results = read_results(job, job.params.noise_um, job.params.length)
    printed = read_printed_figures(job.input.reference)
    write_csvs(job, table=compare_figures(printed, OurResults(tables, results)))
