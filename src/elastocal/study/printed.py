"""The paper's printed figures beside ours, against how studies of the same size
scatter, and all at once.

The paper is one study. Where k studies of one size have a mean m and a standard
deviation s, a further one lies at m + s sqrt(1 + 1/k) t, with t of Student's
distribution with k - 1 degrees of freedom [1]; its tails are the p value of the
difference. Many figures are judged at once by Holm's procedure [2].

Figures of one study move together, so that neither how many lie outside nor the product
of their p values has a known distribution. Each further study is therefore judged by
all others as the paper is by all: by how many figures have p below the level, and by
Fisher's statistic -2 sum ln p [3]. The rank of the paper among the studies is a p value
without assumptions about how figures depend on one another [4]; of k studies it is no
smaller than 1/(k + 1).

[1] Geisser, S., Predictive Inference: An Introduction, Chapman and Hall, 1993. [2]
Holm, S., A simple sequentially rejective multiple test procedure, Scandinavian Journal
of Statistics 6, 1979. [3] Fisher, R. A., Statistical Methods for Research Workers,
Oliver and Boyd, 1932. [4] Barnard, G. A., discussion of The spectral analysis of point
processes, Journal of the Royal Statistical Society B 25, 1963.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import stdtr

from elastocal.io.data_frames import read_long
from elastocal.study.evaluation import make_metrics_schema, make_repeated_schema
from elastocal.study.jobs import (
    MICRO,
    MILLI,
    Job,
    read_frames,
    read_printed_figures,
    write_csvs,
)
from elastocal.study.metrics import extrapolate_length
from elastocal.study.simulation import INITIAL, compute_statistics
from elastocal.study.tables import (
    COMPLIANCE,
    compute_deviation_ratio,
    compute_share_compensated,
    read_all_replicates,
)

# A figure differs from the study where its p value, corrected for all figures, is below
# this.
SIGNIFICANCE_LEVEL = 0.05
# Robot and quantity that the study has a parameter for, chosen to meet it.
FITTED = ("kuka_extended", "deviation_mean")
# Last printed digit, by the first letters of a quantity.
_DIGIT = {"c": 1e-3, "k_sigma": 1e-3, "dev_": 1e-3, "n_": 1.0}
_TABLE4 = {"k_sigma_20": "k_sigma_20_percent", "dev_20": "dev_20_um"}
_FIGURE = ["table", "robot", "strategy", "quantity", "unit"]


@dataclass(frozen=True)
class OurResults:
    """Everything that a printed figure may be compared with.

    `tables`: table1 .. table4 and extended. `metrics`, `replicates`: long; of all
    robots and strategies. `noise_um`, `length`: noise level and data set length of the
    tables.
    """

    tables: dict[str, pd.DataFrame]
    metrics: pd.DataFrame
    replicates: pd.DataFrame
    noise_um: float
    length: int

    def cell(self, name: str, column: str, **key: str) -> tuple[float, float]:
        """Value and standard error of one cell; not a number where the table lacks
        it."""
        rows = self.tables[name]
        for head, value in key.items():
            rows = rows[rows[head] == value]
        if rows.empty or column not in rows:
            return np.nan, np.nan
        return float(rows[column].iloc[0]), float(
            rows.get(f"{column}_std_error", pd.Series(0.0, rows.index)).iloc[0]
        )

    def find(self, figure: Any) -> tuple[float, float, str]:
        """Ours of a printed figure, its spread and its interpretation."""
        robot = figure.robot
        quantity = figure.quantity
        if figure.table == "text":
            return self._of_text(quantity)
        if figure.table == "1":
            return (
                self.cell("table1", COMPLIANCE.format(quantity[1:]), robot=robot)[0],
                0.0,
                "R1: an input",
            )
        if figure.table == "2":
            remark = (
                "R11: the tube was chosen for it"
                if (robot, quantity) == FITTED
                else "R3"
            )
            return *self.cell(
                "table2", f"{quantity.removeprefix('deviation_')}_mm", robot=robot
            ), remark
        if figure.table == "3":
            return *self.cell(
                "table3", COMPLIANCE.format(quantity[1:]), robot=robot
            ), "R7"
        column = _TABLE4.get(quantity, quantity)
        key = {"strategy": figure.strategy, "robot": robot}
        if "k_sigma" not in column:
            return *self.cell("table4", column, **key), "R8"
        whole, fixed = (
            self.cell("table4", f"{column}{end}", **key)
            for end in ("", "_fixed_joints")
        )
        return (
            *fixed,
            "R7" if fixed == whole else "R7, R10: joints fixed in the last stage",
        )

    def _of_text(self, quantity: str) -> tuple[float, float, str]:
        at = (self.noise_um, self.length)
        long = (self.metrics, self.replicates)
        if quantity == "residual_deviation_upper_bound":
            extended = self.tables["extended"]
            if extended.empty:
                return np.nan, np.nan, ""
            worst = extended.iloc[extended.residual_mean_um.argmax()]
            remark = "R11: largest of all strategies; the paper prints a bound"
            return worst.residual_mean_um, worst.residual_mean_um_std_error, remark
        if quantity == "share_compensated_with_link_elasticity":
            return *self.cell(
                "extended", "share_compensated_percent", strategy="6DoF"
            ), "R11, strategy 6DoF"
        if quantity == "share_compensated_joint_elasticity_only":
            return *compute_share_compensated(
                *long, "kuka", "6DoF", *at
            ), "kuka, strategy 6DoF"
        cells = self.tables["table4"].groupby("robot", sort=True)
        best = [rows.iloc[rows[f"dev_{self.length}_um"].argmin()] for _, rows in cells]
        ratios = [
            compute_deviation_ratio(*long, each.robot, "6DoF", each.strategy, *at)
            for each in best
        ]
        return *min(
            ratios
        ), "R8: the best strategy of each robot, the smaller robot ratio"


def compare_figures(reference: pd.DataFrame, ours: OurResults) -> pd.DataFrame:
    """One row for each figure that the paper prints.

    `reference`: as printed, with a value; empty strings where a figure belongs to none.
    Returns its heads and paper, ours, mc_std (standard deviation between studies of
    this size, by bootstrap over data sets and test configurations), z = (ours - paper)
    / mc_std, interpretation. What the study does not cover is empty.
    """
    rows = []
    figure: Any
    for figure in reference.itertuples():
        value, spread, interpretation = ours.find(figure)
        z = (
            (value - figure.value) / spread
            if spread > 0 and np.isfinite(value)
            else np.nan
        )
        rows.append(
            (
                *(getattr(figure, name) for name in _FIGURE),
                figure.value,
                value,
                spread,
                z,
                interpretation,
            )
        )
    return pd.DataFrame(
        rows, columns=[*_FIGURE, "paper", "ours", "mc_std", "z", "interpretation"]
    )


@dataclass(frozen=True)
class StudyScatter:
    """How studies of one size scatter in one figure.

    `values` (k,): of each study; lengths as logarithms. `digit`: last printed one: a
    printed figure is rounded.
    """

    values: np.ndarray
    logarithmic: bool
    digit: float

    @property
    def mean(self) -> float:
        """Mean, of lengths the geometric one."""
        middle = float(self.values.mean())
        return float(np.exp(middle)) if self.logarithmic else middle

    @property
    def std(self) -> float:
        """Standard deviation between studies; of lengths in configurations."""
        spread = float(self.values.std(ddof=1))
        return spread * self.mean if self.logarithmic else spread

    def p_value(self, printed: float) -> float:
        """Two-sided, of a further study that lies so far out."""
        digit, value = (
            (self.digit / printed, np.log(printed))
            if self.logarithmic
            else (self.digit, printed)
        )
        count = len(self.values)
        variance = self.values.var(ddof=1) * (1 + 1 / count) + digit**2 / 12
        return float(
            2 * stdtr(count - 1, -abs((value - self.values.mean()) / np.sqrt(variance)))
        )


def predict_scatter(
    studies: pd.DataFrame,
    robot: str,
    strategy: str,
    quantity: str,
    length: int,
    fixed_joints: bool = True,
) -> StudyScatter | None:
    """How one figure of Table 3 or 4 scatters between studies.

    `studies`: robot and the columns of `evaluation.repeated`. `quantity`: c1..,
    k_sigma_20, dev_20, n_k_sigma_1_percent, n_dev_2_um: with its length or its limit.
    `length`: data set length of figures that name none. `fixed_joints`: whether k_sigma
    counts the joints fixed in the last stage alone (interpretation R10). Returns None
    where the studies do not have it.
    """
    rows = studies[(studies.robot == robot) & (studies.strategy == strategy)]
    if rows.empty or not (
        quantity[1:].isdigit() or quantity.startswith(("k_sigma_", "dev_", "n_"))
    ):
        return None
    digit = next(digit for start, digit in _DIGIT.items() if quantity.startswith(start))
    column = (
        "deviation"
        if "dev" in quantity
        else "k_sigma_fixed_joints"
        if fixed_joints
        else "k_sigma"
    )
    scale = MICRO if column == "deviation" else 1.0
    if not quantity.startswith("n_"):
        place = int(quantity.rpartition("_")[2]) if "_" in quantity else length
        column, scale = (
            (f"compliance_{quantity[1:]}", MICRO)
            if quantity[1:].isdigit()
            else (column, scale)
        )
        values = scale * rows.loc[rows.length == place, column].to_numpy()
        return StudyScatter(values, False, digit) if len(values) > 1 else None
    curves = rows.pivot(index="study", columns="length", values=column).to_numpy()
    limit = float(quantity.split("_")[-2]) / scale
    return (
        StudyScatter(np.log(extrapolate_length(curves, limit)), True, digit)
        if len(curves) > 1
        else None
    )


def correct_by_holm(p_values: np.ndarray) -> np.ndarray:
    """p values corrected for their number, ndarray (N,); not a number where there is
    none."""
    order = np.argsort(p_values)[: np.count_nonzero(~np.isnan(p_values))]
    found = np.full(len(p_values), np.nan)
    found[order] = np.minimum(
        np.maximum.accumulate(p_values[order] * np.arange(len(order), 0, -1)), 1.0
    )
    return found


def build_comparison_table(
    beside: pd.DataFrame,
    studies: pd.DataFrame,
    initial: Mapping[str, pd.DataFrame],
    length: int,
) -> pd.DataFrame:
    """The printed figures judged by further studies.

    `beside`: by `beside_paper`. `studies`: as in `predict_scatter`. `initial`: the
    initial table of each robot. `length`: of Table 3. Returns `beside` with
    studies_mean, studies_std and p_value: of further studies for Tables 3 and 4 (p_holm
    corrects for these), of single data sets for Table 2; without a p value where the
    study was fitted to the figure.
    """

    def judged(figure: Any) -> tuple[float, float, float]:
        if figure.table == "2" and figure.robot in initial:
            statistics = compute_statistics(initial[figure.robot])
            values = (
                MILLI
                * statistics[figure.quantity.removeprefix("deviation_")].to_numpy()
            )
            rank = min((values <= figure.paper).sum(), (values >= figure.paper).sum())
            fitted = (figure.robot, figure.quantity) == FITTED
            return (
                values.mean(),
                values.std(ddof=1),
                np.nan if fitted else min(2 * (rank + 1) / (len(values) + 1), 1.0),
            )
        if figure.table in ("3", "4"):
            found = predict_scatter(
                studies, figure.robot, figure.strategy, figure.quantity, length
            )
            if found:
                return found.mean, found.std, found.p_value(figure.paper)
        return np.nan, np.nan, np.nan

    scattered = [judged(figure) for figure in beside.itertuples()]
    found = pd.DataFrame(
        scattered, beside.index, ["studies_mean", "studies_std", "p_value"], float
    )
    return beside.join(
        found.assign(
            p_holm=correct_by_holm(
                found.p_value.where(beside.table.isin(["3", "4"])).to_numpy()
            )
        )
    )


def build_joint_table(
    studies: pd.DataFrame, reference: pd.DataFrame, length: int
) -> pd.DataFrame:
    """The joint test under both counts of joints in k_sigma (R10).

    Returns joints (fixed joints or all joints), cells, differ (after Holm's
    correction), studies; below (p below the level) and statistic (Fisher's), each with
    the median and the largest of the studies and the p value.
    """
    rows = []
    printed: list[Any] = [*reference[reference.table.isin(["3", "4"])].itertuples()]
    for joints in ("fixed joints", "all joints"):
        fixed = joints == "fixed joints"
        found = [
            (
                predict_scatter(
                    studies, f.robot, f.strategy, f.quantity, length, fixed
                ),
                f.value,
            )
            for f in printed
        ]
        # p values of the paper by all studies, and of each study by the others.
        paper = np.array(
            [scatter.p_value(value) for scatter, value in found if scatter]
        )
        others = np.array(
            [_judge_by_others(scatter) for scatter, _ in found if scatter]
        ).T
        row: dict[str, Any] = {"joints": joints, "cells": len(paper)}
        if not len(paper):
            paper = np.full(1, np.nan)
            others = np.full((1, 1), np.nan)
        row |= {
            "differ": int((correct_by_holm(paper) < SIGNIFICANCE_LEVEL).sum()),
            "studies": len(others),
        }
        row |= _rank(
            "below",
            int((paper < SIGNIFICANCE_LEVEL).sum()),
            (others < SIGNIFICANCE_LEVEL).sum(axis=1),
        )
        rows.append(
            row
            | _rank(
                "statistic",
                float(-2 * np.log(paper).sum()),
                -2 * np.log(others).sum(axis=1),
            )
        )
    return pd.DataFrame(rows)


def _judge_by_others(scatter: StudyScatter) -> list[float]:
    """p value of each study by the others."""
    some = scatter.values  # noqa: PD011 (of a dataclass)
    printed = np.exp(some) if scatter.logarithmic else some
    return [
        replace(scatter, values=np.delete(some, place)).p_value(value)
        for place, value in enumerate(printed)
    ]


def _rank(name: str, value: float, others: np.ndarray) -> dict[str, float]:
    row = {
        name: value,
        f"{name}_studies_median": float(np.median(others)),
        f"{name}_studies_largest": float(others.max()),
    }
    return row | {f"{name}_p": (1 + int((others >= value).sum())) / (1 + len(others))}


def compare_with_paper(job: Job) -> None:
    """Every printed figure beside ours."""
    tables = {
        name: pd.read_csv(job.input[name])
        for name in ("table1", "table2", "table3", "table4", "extended")
    }
    long = read_long(job.input.metrics, make_metrics_schema), read_all_replicates(job)
    ours = OurResults(tables, *long, job.params.noise_um, job.params.length)
    write_csvs(
        job, table=compare_figures(read_printed_figures(job.input.reference), ours)
    )


def compare_with_studies(job: Job) -> None:
    """Every printed figure among further studies, and all at once."""
    beside = pd.read_csv(job.input.beside, dtype={"table": str})
    initial = read_frames(job, job.input.initial, INITIAL)
    studies = read_long(job.input.studies, make_repeated_schema)
    joint = build_joint_table(
        studies, read_printed_figures(job.input.reference), job.params.length
    )
    write_csvs(
        job,
        table=build_comparison_table(beside, studies, initial, job.params.length),
        joint=joint,
    )
