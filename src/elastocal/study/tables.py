"""The paper's tables and the additional ones as data frames, from the metrics of all
strategies; and their form for people.

Long frames have the columns robot, noise_um and strategy in front of those of the files.
Every quantity measured by simulation has a column with its Monte Carlo standard error,
``<quantity>_std_error``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_robot_tables
from elastocal.mechanics.robot_file import parse_robot
from elastocal.study.evaluation import find_length_with_error
from elastocal.study.jobs import MICRO, MILLI, Job, add_slugs, read_frames, write_csvs
from elastocal.study.schemas import INITIAL, METRICS, REPLICATES
from elastocal.study.simulation import compute_statistics, draw_bootstrap_weights

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from elastocal.io.data_frames import Frames
    from elastocal.io.storage import Columns
    from elastocal.mechanics.robot import Robot


# Name of a joint's compliance in tables for people, by the number of the joint; in files
# it is ``compliance_{}``, rad/(N m).
COMPLIANCE = "compliance_{}_urad_per_Nm"


@dataclass(frozen=True)
class Results:
    """Metrics of all robots and strategies, and the cell that the tables show.

    Attributes
    ----------
    metrics, replicates
        Long tables.
    noise_um : float
        Noise level of the tables.
    length : int
        Data set length of the tables.
    """

    metrics: pd.DataFrame
    replicates: pd.DataFrame
    noise_um: float
    length: int

    def select_metrics(self, robot: str, strategy: str) -> pd.DataFrame:
        """Metrics of a strategy on a robot by the length; empty if not studied."""
        return self._select(self.metrics, robot, strategy).set_index("length")

    def select_replicates(self, robot: str, strategy: str) -> pd.DataFrame:
        """Bootstrap replicates of a strategy on a robot."""
        return self._select(self.replicates, robot, strategy)

    def _select(self, frame: pd.DataFrame, robot: str, strategy: str) -> pd.DataFrame:
        return frame[
            (frame.robot == robot)
            & (frame.noise_um == self.noise_um)
            & (frame.strategy == strategy)
        ]

    def get_row(self, robot: str, strategy: str) -> pd.Series:
        """Metrics of a strategy on a robot at the length of the tables."""
        return _get_row(self.select_metrics(robot, strategy), self.length)

    def compute_share_compensated(
        self, robot: str, strategy: str
    ) -> tuple[float, float]:
        """Share of the initial deviation that calibration removes, in percent, with its
        standard error; NaN if not studied."""
        cell = self.select_metrics(robot, strategy)
        if cell.empty:
            return np.nan, np.nan
        row = _get_row(cell, self.length)
        replicates = self.select_replicates(robot, strategy)
        replicates = replicates[replicates.length == self.length]
        shares = 100 * (1 - replicates.deviation / replicates.initial_deviation)
        share = 100 * (1 - row.deviation / row.initial_deviation)
        return float(share), float(shares.std(ddof=1))

    def compute_deviation_ratio(
        self, robot: str, strategy: str, divisor: str
    ) -> tuple[float, float]:
        """Deviation of a strategy over that of the divisor, with its standard error; NaN
        if not studied."""
        values = []
        drawn = []
        for name in (strategy, divisor):
            cell = self.select_metrics(robot, name)
            if cell.empty:
                return np.nan, np.nan
            values.append(cell.deviation.loc[self.length])
            replicates = self.select_replicates(robot, name)
            at_length = replicates[replicates.length == self.length]
            drawn.append(at_length.deviation.to_numpy())
        std_error = np.std(drawn[0] / drawn[1], ddof=1)
        return float(values[0] / values[1]), float(std_error)


def _get_row(cell: pd.DataFrame, length: int) -> pd.Series:
    """The row of a length, which occurs once."""
    row = cell.loc[length]
    assert isinstance(row, pd.Series)
    return row


def build_table1(robots: Mapping[str, Robot]) -> pd.DataFrame:
    """Table 1: joint compliances that the study takes as true, µrad/(N m)."""
    rows = []
    for name, robot in robots.items():
        row: dict[str, str | float] = {"robot": name}
        for number, value in enumerate(MICRO * robot.compliance, 1):
            row[COMPLIANCE.format(number)] = value
        rows.append(row)
    return pd.DataFrame(rows)


def build_table2(initial: Frames, weights: Columns) -> pd.DataFrame:
    """Table 2: end-effector deviation before calibration, over all configurations of all
    data sets.

    Parameters
    ----------
    initial
        The initial table of each robot.
    weights
        Bootstrap weights (1 + replicates, sets) of each robot's data sets.

    Returns
    -------
    DataFrame
        Mean, standard deviation and maximum; the bootstrap has no standard error for a
        maximum. ``mean_mm_one_set`` and ``mean_mm_one_set_std`` are the average and the
        spread of the same quantity of single data sets.
    """
    rows = []
    for robot, frame in initial.items():
        row: dict[str, str | float] = {"robot": robot}
        weight = weights[robot]
        count = weight @ frame.configurations
        mean = weight @ (frame.configurations * frame["mean"]) / count
        mean_square = weight @ (frame.configurations * frame.mean_square) / count
        for name, values in (("mean", mean), ("std", np.sqrt(mean_square - mean**2))):
            row[f"{name}_mm"] = float(MILLI * values[0])
            spread = np.std(MILLI * values[1:], ddof=1)
            row[f"{name}_mm_std_error"] = float(spread)
        row["max_mm"] = MILLI * frame.maximum.max()
        for name, statistic in compute_statistics(frame).items():
            row[f"{name}_mm_one_set"] = MILLI * statistic.mean()
            row[f"{name}_mm_one_set_std"] = MILLI * statistic.std(ddof=1)
        rows.append(row)
    return pd.DataFrame(rows)


def build_table3(
    results: Results, robots: Iterable[str], strategy: str
) -> pd.DataFrame:
    """Table 3: compliances from the averaged stiffness (equation 12) by one strategy,
    µrad/(N m)."""
    rows = []
    for robot in robots:
        cell = results.get_row(robot, strategy)
        row: dict[str, str | float] = {"robot": robot}
        # If another robot has more joints, the columns of the joints that this one lacks
        # are empty.
        joints = cell.filter(regex=r"^compliance_\d+$").notna().sum()
        for j in range(1, int(joints) + 1):
            for suffix in ("", "_std_error"):
                value = MICRO * cell[f"compliance_{j}{suffix}"]
                row[COMPLIANCE.format(j) + suffix] = value
        rows.append(row)
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class _Table4Score:
    """A score of Table 4, and the length from which on it stays within its limit.

    Attributes
    ----------
    column : str
        Column of the metrics.
    factor : float
        From the unit of the metrics to that of the table.
    limit : float
        In the unit of the table.
    score_name, length_name : str
        Columns of the table.
    """

    column: str
    factor: float
    limit: float
    score_name: str
    length_name: str


def build_table4(
    results: Results,
    robots: Iterable[str],
    strategies: Iterable[str],
    k_sigma_limit_percent: float,
    deviation_limit_um: float,
) -> pd.DataFrame:
    """Table 4: scores of the strategies at one noise level and length, and the lengths
    from which on they stay within a limit.

    Infinite if the longest data set is not within the limit.
    """
    length = results.length
    scores = [
        _Table4Score(
            f"k_sigma{suffix}",
            1.0,
            k_sigma_limit_percent,
            f"k_sigma_{length}_percent{suffix}",
            f"n_k_sigma_{k_sigma_limit_percent:g}_percent{suffix}",
        )
        for suffix in ("", "_fixed_joints")
    ]
    scores.append(
        _Table4Score(
            "deviation",
            MICRO,
            deviation_limit_um,
            f"dev_{length}_um",
            f"n_dev_{deviation_limit_um:g}_um",
        )
    )
    rows = []
    for strategy, robot in product(strategies, [*robots]):
        cell = results.select_metrics(robot, strategy)
        replicates = results.select_replicates(robot, strategy)
        row: dict[str, str | float] = {"strategy": strategy, "robot": robot}
        for score in scores:
            row |= _evaluate_score(score, cell, replicates, length)
        rows.append(row)
    return pd.DataFrame(rows)


def _evaluate_score(
    score: _Table4Score, cell: pd.DataFrame, replicates: pd.DataFrame, length: int
) -> dict[str, float]:
    """Value of one score and the length from which on it stays within its limit, each with its
    standard error."""
    row = _get_row(cell, length)
    curves = replicates.pivot(
        index="replicate", columns="length", values=score.column
    ).to_numpy()
    needed, needed_error = find_length_with_error(
        cell[score.column].to_numpy(), curves, score.limit / score.factor
    )
    std_error = score.factor * row[f"{score.column}_std_error"]
    return {
        score.score_name: score.factor * row[score.column],
        f"{score.score_name}_std_error": std_error,
        score.length_name: needed,
        f"{score.length_name}_std_error": needed_error,
    }


# Columns of the table of robots with elastic links, which may have no rows.
_EXTENDED_COLUMNS = (
    "strategy",
    "initial_mean_mm",
    "initial_mean_mm_std_error",
    "residual_mean_um",
    "residual_mean_um_std_error",
    "share_compensated_percent",
    "share_compensated_percent_std_error",
    "robot",
)


def build_extended_table(
    results: Results, robots: Iterable[str], strategies: Iterable[str]
) -> pd.DataFrame:
    """Deviation of robots with elastic links that the reduced model leaves."""
    rows = []
    for robot, strategy in product(robots, [*strategies]):
        cell = results.get_row(robot, strategy)
        row = (
            strategy,
            MILLI * cell.initial_deviation,
            MILLI * cell.initial_deviation_std_error,
            MICRO * cell.deviation,
            MICRO * cell.deviation_std_error,
            *results.compute_share_compensated(robot, strategy),
            robot,
        )
        rows.append(row)
    return pd.DataFrame(rows, columns=[*_EXTENDED_COLUMNS])


def merge_errors(frame: pd.DataFrame, digits: int = 3) -> pd.DataFrame:
    """Merge each value with its standard error, for people: value ± error.

    An infinite length becomes "not reached". `digits` is the number of significant
    digits of a value without error.
    """
    merged = {}
    for column in frame.columns:
        if column.endswith("_std_error"):
            continue
        errors = frame.get(f"{column}_std_error", pd.Series(np.nan, frame.index))
        merged[column] = [
            format_value(value, error, digits)
            for value, error in zip(frame[column], errors, strict=True)
        ]
    return pd.DataFrame(merged)


def list_rows(frame: pd.DataFrame) -> list[list[str]]:
    """List the rows of a table for people, its header first.

    Columns about single data sets and file names are left out.
    """
    internal = frame.columns.str.contains("_one_set|strategy_file")
    merged = merge_errors(frame.loc[:, ~internal])
    header = [format_column_head(name) for name in merged.columns]
    return [header, *merged.to_numpy().tolist()]


def format_column_head(name: str) -> str:
    """Format the name of a column or a quantity for people, with its unit.

    Names of other quantities than the paper's get blanks for underscores.
    """
    quantity = name.removesuffix("_fixed_joints")
    suffix = ", fixed joints" if quantity != name else ""
    for pattern, template in _HEADS:
        match = re.fullmatch(pattern, quantity)
        if match:
            return template.format(*match.groups()) + suffix
    return name.replace("_", " ")


_HEADS = (
    (r"compliance_(\d+)_urad_per_Nm", "c{} (µrad/(N·m))"),
    (r"k_sigma_(\d+)(?:_percent)?", "k_Σ at {} (%)"),
    (r"n_k_sigma_([\d.]+)_percent", "n, k_Σ ≤ {} %"),
    (r"dev_(\d+)(?:_um)?", "dev at {} (µm)"),
    (r"n_dev_([\d.]+)_um", "n, dev ≤ {} µm"),
    (r"(mean|std|max)_mm", "{} (mm)"),
    (r"deviation_(mean|std|max)", "{} (mm)"),
)


def format_value(value: float | str, error: float, digits: int = 3) -> str:
    """Format a value for people, with two digits of its standard error.

    Parameters
    ----------
    value
        Text stays as it is.
    error : float
        NaN or zero if there is none.
    digits : int
        Significant digits of a value without error.
    """
    if isinstance(value, str):
        return value
    if np.isinf(value):
        return "not reached"
    if np.isnan(value):
        return ""
    if not np.isfinite(error) or error <= 0:
        return f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"
    decimals = max(0, 1 - int(np.floor(np.log10(error))))
    return f"{value:.{decimals}f} ± {error:.{decimals}f}"


def read_results(job: Job, noise_um: float, length: int) -> Results:
    """Read the metrics and bootstrap replicates of all strategies for tables of a noise
    level and a length."""
    metrics = read_robot_tables(job.input.metrics, METRICS)
    replicates = read_robot_tables(job.input.replicates, REPLICATES)
    return Results(metrics, replicates, noise_um, length)


def tabulate_compliances(job: Job) -> None:
    """Write Table 1."""
    robots = {
        name: parse_robot(document, name)
        for name, document in job.params.robots.items()
    }
    write_csvs(job, table=build_table1(robots))


def tabulate_initial(job: Job) -> None:
    """Write Table 2."""
    params = job.params
    initial = read_frames(job, job.input.initial, INITIAL)
    weights = {
        name: draw_bootstrap_weights(
            params.seed, name, frame.data_set.to_numpy(), params.replicates
        )
        for name, frame in initial.items()
    }
    write_csvs(job, table=build_table2(initial, weights))


def tabulate_identified(job: Job) -> None:
    """Write Table 3, which needs no replicates."""
    params = job.params
    metrics = read_robot_tables(job.input.metrics, METRICS)
    results = Results(metrics, pd.DataFrame(), params.noise_um, params.length)
    write_csvs(job, table=build_table3(results, params.robots, params.strategy))


def tabulate_strategies(job: Job) -> None:
    """Write Table 4."""
    params = job.params
    cells = params.cells
    table = build_table4(
        read_results(job, cells["noise_um"], cells["length"]),
        params.robots,
        params.strategies,
        cells["k_sigma_limit_percent"],
        cells["deviation_limit_um"],
    )
    write_csvs(job, table=add_slugs(table, params.strategies))


def tabulate_extended(job: Job) -> None:
    """Write the table of robots with elastic links."""
    params = job.params
    results = read_results(job, params.noise_um, params.length)
    write_csvs(
        job, table=build_extended_table(results, params.robots, params.strategies)
    )
