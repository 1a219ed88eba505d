"""The paper's printed figures next to ours, among the scatter of studies of the same
size, one by one and jointly.

The paper is one study. If k studies of one size have a mean m and a standard deviation
s, a further one lies at m + s sqrt(1 + 1/k) t, with t of Student's distribution with
k - 1 degrees of freedom [1]; the tails of this distribution are the p value of the
difference. Holm's procedure [2] corrects the p values for the number of figures.

The figures of one study are dependent, so that neither the number of figures outside nor
the product of their p values has a known distribution. Each further study is therefore
judged by all others as the paper is by all: by the number of figures with p below the
level, and by Fisher's statistic -2 sum ln p [3]. The rank of the paper among the studies
is a p value without assumptions about the dependence of figures [4]; with k studies it
is at least 1/(k + 1).

References
----------
.. [1] Geisser, S., Predictive Inference: An Introduction, Chapman and Hall, 1993.
.. [2] Holm, S., A simple sequentially rejective multiple test procedure, Scandinavian
   Journal of Statistics 6, 1979.
.. [3] Fisher, R. A., Statistical Methods for Research Workers, Oliver and Boyd, 1932.
.. [4] Barnard, G. A., discussion of The spectral analysis of point processes, Journal of
   the Royal Statistical Society B 25, 1963.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtr

from elastocal.io.data_frames import Frames, read_robot_tables
from elastocal.study.jobs import (
    MICRO,
    MILLI,
    Job,
    read_frames,
    read_printed_figures,
    write_csvs,
)
from elastocal.study.metrics import extrapolate_length
from elastocal.study.schemas import INITIAL, REPEATED
from elastocal.study.simulation import compute_statistics
from elastocal.study.tables import COMPLIANCE, Results, read_results

# A figure differs from the study if its p value, corrected for the number of figures, is
# below this level.
SIGNIFICANCE_LEVEL = 0.05
# Robot and quantity for which a parameter of the study was chosen.
FITTED = ("kuka_extended", "deviation_mean")
# Last printed digit, by the first letters of a quantity.
_LAST_DIGITS = {"c": 1e-3, "k_sigma": 1e-3, "dev_": 1e-3, "n_": 1.0}
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
            column = f"{quantity.removeprefix('deviation_')}_mm"
            cell = self.get_cell("table2", column, robot=robot)
            return cell, "R11: the tube was chosen for it" if fitted else "R3"
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
        size, by bootstrap over data sets and test configurations), z = (ours - paper) /
        mc_std, interpretation. Values that the study does not cover are empty.
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


@dataclass(frozen=True)
class StudyScatter:
    """Scatter of one figure between studies of one size.

    Attributes
    ----------
    values : (k,) array
        Of each study; lengths as logarithms.
    logarithmic : bool
        Whether the values are logarithms.
    digit : float
        Last printed digit, to which a printed figure is rounded.
    """

    values: np.ndarray
    logarithmic: bool
    digit: float

    @property
    def mean(self) -> float:
        """Mean; the geometric one of lengths."""
        mean = float(self.values.mean())
        return float(np.exp(mean)) if self.logarithmic else mean

    @property
    def std(self) -> float:
        """Standard deviation between studies; in configurations for lengths."""
        std = float(self.values.std(ddof=1))
        return std * self.mean if self.logarithmic else std

    def compute_p_value(self, printed: float) -> float:
        """Two-sided p value of a further study with the printed value."""
        return self._compute_p_value(self.values, printed)

    def compute_p_values_by_others(self) -> list[float]:
        """Two-sided p value of each study by all others."""
        printed = np.exp(self.values) if self.logarithmic else self.values
        return [
            self._compute_p_value(np.delete(self.values, index), value)
            for index, value in enumerate(printed)
        ]

    def _compute_p_value(self, values: np.ndarray, printed: float) -> float:
        digit = self.digit
        value = printed
        if self.logarithmic:
            digit = self.digit / printed
            value = np.log(printed)
        count = len(values)
        # Rounding adds the variance of a uniform distribution.
        variance = values.var(ddof=1) * (1 + 1 / count) + digit**2 / 12
        t = (value - values.mean()) / np.sqrt(variance)
        return float(2 * stdtr(count - 1, -abs(t)))


def predict_scatter(
    studies: pd.DataFrame,
    figure: Any,
    length: int,
    *,
    fixed_joints: bool = True,
) -> StudyScatter | None:
    """Predict how one figure of Table 3 or 4 scatters between studies.

    Parameters
    ----------
    studies
        Robot and the columns of the table of repeated studies.
    figure
        Has ``robot``, ``strategy`` and ``quantity``: c1.., k_sigma_20, dev_20,
        n_k_sigma_1_percent, n_dev_2_um, with its length or its limit.
    length : int
        Data set length of quantities that name none.
    fixed_joints : bool
        Whether k_sigma counts only the joints fixed in the last stage (interpretation
        R10).

    Returns
    -------
    StudyScatter or None
        None if fewer than two studies have the figure.
    """
    rows = studies[
        (studies.robot == figure.robot) & (studies.strategy == figure.strategy)
    ]
    column = _choose_column(figure.quantity, fixed_joints=fixed_joints)
    if rows.empty or column is None:
        return None
    quantity = figure.quantity
    digit = next(
        digit for start, digit in _LAST_DIGITS.items() if quantity.startswith(start)
    )
    scale = 1.0 if column.startswith("k_sigma") else MICRO
    logarithmic = quantity.startswith("n_")
    if logarithmic:
        limit = float(quantity.split("_")[-2]) / scale
        curves = rows.pivot(index="study", columns="length", values=column)
        values = np.log(extrapolate_length(curves.to_numpy(), limit))
    else:
        if "_" in quantity:
            length = int(quantity.rpartition("_")[2])
        values = scale * rows.loc[rows.length == length, column].to_numpy()
    if len(values) < 2:
        return None
    return StudyScatter(values, logarithmic, digit)


def _choose_column(quantity: str, *, fixed_joints: bool) -> str | None:
    """Column of the table of repeated studies that holds a quantity of Table 3 or 4."""
    if quantity[1:].isdigit():
        return f"compliance_{quantity[1:]}"
    if not quantity.startswith(("k_sigma_", "dev_", "n_")):
        return None
    if "dev" in quantity:
        return "deviation"
    return "k_sigma_fixed_joints" if fixed_joints else "k_sigma"


def correct_by_holm(p_values: np.ndarray) -> np.ndarray:
    """Correct p values (N,) for their number; NaN stays NaN and is not counted."""
    order = np.argsort(p_values)[: np.count_nonzero(~np.isnan(p_values))]
    factors = np.arange(len(order), 0, -1)
    corrected = np.full(len(p_values), np.nan)
    corrected[order] = np.minimum(np.maximum.accumulate(p_values[order] * factors), 1.0)
    return corrected


def build_comparison_table(
    compared: pd.DataFrame,
    studies: pd.DataFrame,
    initial: Frames,
    length: int,
) -> pd.DataFrame:
    """Judge the printed figures by further studies.

    Parameters
    ----------
    compared
        From `compare_figures`.
    studies
        As in `predict_scatter`.
    initial
        The initial table of each robot.
    length : int
        Of Table 3.

    Returns
    -------
    DataFrame
        `compared` with studies_mean, studies_std and p_value: of further studies for
        Tables 3 and 4 (p_holm corrects for these), of single data sets for Table 2;
        without a p value if the study was fitted to the figure.
    """
    judgements = []
    figure: Any
    for figure in compared.itertuples():
        judgement = (np.nan, np.nan, np.nan)
        if figure.table == "2" and figure.robot in initial:
            judgement = _judge_by_data_sets(figure, initial[figure.robot])
        elif figure.table in ("3", "4"):
            scatter = predict_scatter(studies, figure, length)
            if scatter is not None:
                p_value = scatter.compute_p_value(figure.paper)
                judgement = (scatter.mean, scatter.std, p_value)
        judgements.append(judgement)
    columns = ["studies_mean", "studies_std", "p_value"]
    judged = pd.DataFrame(judgements, compared.index, columns, float)
    corrected = judged.p_value.where(compared.table.isin(["3", "4"])).to_numpy()
    return compared.join(judged.assign(p_holm=correct_by_holm(corrected)))


def _judge_by_data_sets(
    figure: Any, initial: pd.DataFrame
) -> tuple[float, float, float]:
    """Mean and standard deviation of a figure of Table 2 over single data sets, and its
    two-sided p value by rank."""
    statistic = compute_statistics(initial)[figure.quantity.removeprefix("deviation_")]
    values = MILLI * statistic.to_numpy()
    p_value = np.nan
    if (figure.robot, figure.quantity) != FITTED:
        rank = min((values <= figure.paper).sum(), (values >= figure.paper).sum())
        p_value = min(2 * (rank + 1) / (len(values) + 1), 1.0)
    return values.mean(), values.std(ddof=1), p_value


def build_joint_table(
    studies: pd.DataFrame, printed: pd.DataFrame, length: int
) -> pd.DataFrame:
    """Test all figures of Tables 3 and 4 jointly, under both counts of joints in k_sigma
    (R10).

    Returns
    -------
    DataFrame
        joints (fixed joints or all joints), cells, differ (after Holm's correction),
        studies; below (number of p values below the level) and statistic (Fisher's),
        each with the median and the largest of the studies and the p value.
    """
    rows = []
    figures: list[Any] = [*printed[printed.table.isin(["3", "4"])].itertuples()]
    for joints in ("fixed joints", "all joints"):
        fixed_joints = joints == "fixed joints"
        paper = []
        by_study = []
        for figure in figures:
            scatter = predict_scatter(
                studies, figure, length, fixed_joints=fixed_joints
            )
            if scatter is not None:
                paper.append(scatter.compute_p_value(figure.value))
                by_study.append(scatter.compute_p_values_by_others())
        row: dict[str, Any] = {"joints": joints, "cells": len(paper)}
        paper_p = np.array(paper or [np.nan])
        study_p = np.array(by_study or [[np.nan]]).T
        differ = int((correct_by_holm(paper_p) < SIGNIFICANCE_LEVEL).sum())
        row |= {"differ": differ, "studies": len(study_p)}
        row |= _rank_among_studies(
            "below",
            int((paper_p < SIGNIFICANCE_LEVEL).sum()),
            (study_p < SIGNIFICANCE_LEVEL).sum(axis=1),
        )
        row |= _rank_among_studies(
            "statistic",
            float(-2 * np.log(paper_p).sum()),
            -2 * np.log(study_p).sum(axis=1),
        )
        rows.append(row)
    return pd.DataFrame(rows)


def _rank_among_studies(
    name: str, value: float, studies: np.ndarray
) -> dict[str, float]:
    """A statistic of the paper with its p value by rank among the studies (k,)."""
    p_value = (1 + int((studies >= value).sum())) / (1 + len(studies))
    return {
        name: value,
        f"{name}_studies_median": float(np.median(studies)),
        f"{name}_studies_largest": float(studies.max()),
        f"{name}_p": p_value,
    }


def compare_with_paper(job: Job) -> None:
    """Write every printed figure next to ours."""
    tables = {
        name: pd.read_csv(job.input[name])
        for name in ("table1", "table2", "table3", "table4", "extended")
    }
    results = read_results(job, job.params.noise_um, job.params.length)
    printed = read_printed_figures(job.input.reference)
    write_csvs(job, table=compare_figures(printed, OurResults(tables, results)))


def compare_with_studies(job: Job) -> None:
    """Write every printed figure among further studies, and the joint test."""
    compared = pd.read_csv(job.input.beside, dtype={"table": str})
    initial = read_frames(job, job.input.initial, INITIAL)
    studies = read_robot_tables(job.input.studies, REPEATED)
    printed = read_printed_figures(job.input.reference)
    length = job.params.length
    write_csvs(
        job,
        table=build_comparison_table(compared, studies, initial, length),
        joint=build_joint_table(studies, printed, length),
    )
