"""The paper's tables and those beside them, as data frames, from the metrics of all
strategies; and how people read them.

Long frames come in with the columns robot, noise_um and strategy in front of those of
the files. Every quantity that was measured by simulation has a column of its Monte
Carlo standard error, ``<quantity>_std_error``.
"""

from __future__ import annotations

import re
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_long
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.evaluation import (
    REPLICATES,
    find_length_with_error,
    make_metrics_schema,
)
from elastocal.study.jobs import MICRO, MILLI, Job, add_slugs, read_frames, write_csvs
from elastocal.study.simulation import (
    INITIAL,
    compute_statistics,
    draw_bootstrap_weights,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from elastocal.mechanics.robot import Robot


# Compliance of a joint by its number, in tables that people read; in files it is
# ``compliance_{}``, rad/(N m).
COMPLIANCE = "compliance_{}_urad_per_Nm"


def build_table1(robots: Mapping[str, Robot]) -> pd.DataFrame:
    """Joint compliances that the study takes as true, µrad/(N m)."""
    found = {name: MICRO * robot.compliance for name, robot in robots.items()}
    return pd.DataFrame(
        [
            {"robot": name} | {COMPLIANCE.format(j): c for j, c in enumerate(row, 1)}
            for name, row in found.items()
        ]
    )


def build_table2(
    initial: Mapping[str, pd.DataFrame], weights: Mapping[str, np.ndarray]
) -> pd.DataFrame:
    """End-effector deviation before calibration, over all configurations of all data
    sets.

    `initial`: the initial table of each robot. `weights` (1 + replicates, sets):
    bootstrap weights of each robot's data sets. The bootstrap has no standard error for
    a maximum. Beside them the average of the same figures of single data sets and its
    spread, ``mean_mm_one_set`` and ``mean_mm_one_set_std``.
    """
    rows = []
    for robot, frame in initial.items():
        count = weights[robot] @ frame.configurations
        mean = weights[robot] @ (frame.configurations * frame["mean"]) / count
        std = np.sqrt(
            weights[robot] @ (frame.configurations * frame.mean_square) / count
            - mean**2
        )
        row: dict[str, str | float] = {"robot": robot}
        for name, values in (("mean_mm", MILLI * mean), ("std_mm", MILLI * std)):
            row |= {
                name: float(values[0]),
                f"{name}_std_error": float(np.std(values[1:], ddof=1)),
            }
        row["max_mm"] = MILLI * frame.maximum.max()
        for name, each in compute_statistics(frame).items():
            row |= {
                f"{name}_mm_one_set": MILLI * each.mean(),
                f"{name}_mm_one_set_std": MILLI * each.std(ddof=1),
            }
        rows.append(row)
    return pd.DataFrame(rows)


def build_table3(
    metrics: pd.DataFrame,
    robots: Iterable[str],
    strategy: str,
    noise_um: float,
    length: int,
) -> pd.DataFrame:
    """Compliances from the averaged stiffness (equation 12) by one strategy, µrad/(N
    m)."""
    rows = []
    for robot in robots:
        cell = _row_of(_by_length(metrics, robot, noise_um, strategy), length)
        row: dict[str, str | float] = {"robot": robot}
        # A robot with fewer joints than another one of the same frame has empty columns
        # for those that it lacks.
        for j in range(
            1, int(cell.filter(regex=r"^compliance_\d+$").notna().sum()) + 1
        ):
            row |= {
                COMPLIANCE.format(j) + end: MICRO * cell[f"compliance_{j}{end}"]
                for end in ("", "_std_error")
            }
        rows.append(row)
    return pd.DataFrame(rows)


def build_table4(
    metrics: pd.DataFrame,
    replicates: pd.DataFrame,
    robots: Sequence[str],
    strategies: Iterable[str],
    noise_um: float,
    length: int,
    k_sigma_limit_percent: float,
    deviation_limit_um: float,
) -> pd.DataFrame:
    """Comparison of the strategies at one noise level: scores at a length, and lengths
    at which scores reach a limit.

    A length that no data set reaches is infinite.
    """
    limit = f"{k_sigma_limit_percent:g}_percent"
    # Column of the metrics, its factor, and the limit and names of its score and of the
    # length at which that reaches the limit.
    figures = [
        (
            f"k_sigma{end}",
            1.0,
            k_sigma_limit_percent,
            f"k_sigma_{length}_percent{end}",
            f"n_k_sigma_{limit}{end}",
        )
        for end in ("", "_fixed_joints")
    ]
    figures.append(
        (
            "deviation",
            MICRO,
            deviation_limit_um,
            f"dev_{length}_um",
            f"n_dev_{deviation_limit_um:g}_um",
        )
    )
    rows = []
    for strategy, robot in product(strategies, robots):
        cell = _by_length(metrics, robot, noise_um, strategy)
        drawn = _cell(replicates, robot, noise_um, strategy)
        at = _row_of(cell, length)
        row: dict[str, str | float] = {"strategy": strategy, "robot": robot}
        for name, factor, least, score, reached in figures:
            row |= {
                score: factor * at[name],
                f"{score}_std_error": factor * at[f"{name}_std_error"],
            }
            curves = drawn.pivot(
                index="replicate", columns="length", values=name
            ).to_numpy()
            found = find_length_with_error(
                cell[name].to_numpy(), curves, least / factor
            )
            row |= dict(zip((reached, f"{reached}_std_error"), found, strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def build_extended_table(
    metrics: pd.DataFrame,
    replicates: pd.DataFrame,
    robots: Iterable[str],
    strategies: Sequence[str],
    noise_um: float,
    length: int,
) -> pd.DataFrame:
    """What the reduced model leaves of the deviation of robots with elastic links."""
    rows = []
    for robot, strategy in product(robots, strategies):
        at = _row_of(_by_length(metrics, robot, noise_um, strategy), length)
        initial = MILLI * at.initial_deviation, MILLI * at.initial_deviation_std_error
        left = MICRO * at.deviation, MICRO * at.deviation_std_error
        share = compute_share_compensated(
            metrics, replicates, robot, strategy, noise_um, length
        )
        rows.append((strategy, *initial, *left, *share, robot))
    quantities = ("initial_mean_mm", "residual_mean_um", "share_compensated_percent")
    names = [
        "strategy",
        *(name + suffix for name in quantities for suffix in ("", "_std_error")),
        "robot",
    ]
    return pd.DataFrame(rows, columns=names)


def compute_share_compensated(
    metrics: pd.DataFrame,
    replicates: pd.DataFrame,
    robot: str,
    strategy: str,
    noise_um: float,
    length: int,
) -> tuple[float, float]:
    """Share of the initial deviation that calibration removes, in percent, with its
    standard error; NaN where not studied."""
    cell = _by_length(metrics, robot, noise_um, strategy)
    if cell.empty:
        return np.nan, np.nan
    at = _row_of(cell, length)
    drawn = _cell(replicates, robot, noise_um, strategy).query("length == @length")
    shares = 100 * (1 - drawn.deviation / drawn.initial_deviation)
    return float(100 * (1 - at.deviation / at.initial_deviation)), float(
        shares.std(ddof=1)
    )


def compute_deviation_ratio(
    metrics: pd.DataFrame,
    replicates: pd.DataFrame,
    robot: str,
    strategy: str,
    over: str,
    noise_um: float,
    length: int,
) -> tuple[float, float]:
    """How many times smaller the deviation of `over` is than that of `strategy`, with
    its error; NaN where not studied."""
    values = []
    drawn = []
    for name in (strategy, over):
        cell = _by_length(metrics, robot, noise_um, name)
        if cell.empty:
            return np.nan, np.nan
        values.append(cell.deviation.loc[length])
        drawn.append(
            _cell(replicates, robot, noise_um, name)
            .query("length == @length")
            .deviation.to_numpy()
        )
    return float(values[0] / values[1]), float(np.std(drawn[0] / drawn[1], ddof=1))


def merge_errors(frame: pd.DataFrame, digits: int = 3) -> pd.DataFrame:
    """The same table for people: each value with its standard error behind a ± sign, an
    infinite length as "not reached".

    `digits`: significant digits of a value without error.
    """
    shown = {}
    for column in frame.columns:
        if column.endswith("_std_error"):
            continue
        errors = frame.get(f"{column}_std_error", pd.Series(np.nan, frame.index))
        shown[column] = [
            format_value(value, error, digits)
            for value, error in zip(frame[column], errors, strict=True)
        ]
    return pd.DataFrame(shown)


def list_rows(frame: pd.DataFrame) -> list[list[str]]:
    """The table for people as rows of words, its header first, with names of columns
    that break at blanks."""
    shown = merge_errors(
        frame.loc[:, ~frame.columns.str.contains("_one_set|strategy_file")]
    )
    return [
        [format_column_head(name) for name in shown.columns],
        *shown.to_numpy().tolist(),
    ]


def format_column_head(name: str) -> str:
    """Name of a column or a quantity for people, with its unit.

    Returns names that are not of the paper's quantities with blanks.
    """
    stage = ", fixed joints" if name.endswith("_fixed_joints") else ""
    for pattern, words in _HEADS:
        if found := re.fullmatch(pattern, name.removesuffix("_fixed_joints")):
            return words.format(*found.groups()) + stage
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
    """A value for people, with two digits of its standard error.

    `error`: not a number or zero where there is none. `digits`: significant digits of a
    value without error.
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


def _cell(
    frame: pd.DataFrame, robot: str, noise_um: float, strategy: str
) -> pd.DataFrame:
    return frame[
        (frame.robot == robot)
        & (frame.noise_um == noise_um)
        & (frame.strategy == strategy)
    ]


def _by_length(
    metrics: pd.DataFrame, robot: str, noise_um: float, strategy: str
) -> pd.DataFrame:
    return _cell(metrics, robot, noise_um, strategy).set_index("length")


def _row_of(cell: pd.DataFrame, length: int) -> pd.Series:
    """What `_by_length` has of one length, which stands there once."""
    row = cell.loc[length]
    assert isinstance(row, pd.Series)
    return row


def tabulate_compliances(job: Job) -> None:
    """Table 1."""
    write_csvs(
        job,
        table=build_table1(
            {
                name: robot_from_document(document, name)
                for name, document in job.params.robots.items()
            }
        ),
    )


def tabulate_initial(job: Job) -> None:
    """Table 2."""
    initial = read_frames(job, job.input.initial, INITIAL)
    drawn = job.params.seed, job.params.replicates
    weights = {
        name: draw_bootstrap_weights(
            drawn[0], name, frame.data_set.to_numpy(), drawn[1]
        )
        for name, frame in initial.items()
    }
    write_csvs(job, table=build_table2(initial, weights))


def tabulate_identified(job: Job) -> None:
    """Table 3."""
    asked = job.params
    frame = read_long(job.input.metrics, make_metrics_schema)
    write_csvs(
        job,
        table=build_table3(
            frame, asked.robots, asked.strategy, asked.noise_um, asked.length
        ),
    )


def tabulate_strategies(job: Job) -> None:
    """Table 4."""
    asked = job.params
    long = (read_long(job.input.metrics, make_metrics_schema), read_all_replicates(job))
    write_csvs(
        job,
        table=add_slugs(
            build_table4(*long, asked.robots, [*asked.strategies], **asked.cells),
            asked.strategies,
        ),
    )


def tabulate_extended(job: Job) -> None:
    """Robots with elastic links."""
    asked = job.params
    long = (read_long(job.input.metrics, make_metrics_schema), read_all_replicates(job))
    write_csvs(
        job,
        table=build_extended_table(
            *long, asked.robots, asked.strategies, asked.noise_um, asked.length
        ),
    )


def read_all_replicates(job: Job) -> pd.DataFrame:
    """Bootstrap replicates of the scores of all strategies."""
    return read_long(job.input.replicates, lambda joints: REPLICATES)
