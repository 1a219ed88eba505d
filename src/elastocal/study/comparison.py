"""The paper's printed figures beside ours, each with the Monte Carlo spread of a study of this size; `printed` judges them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from elastocal.study.tables import deviation_ratio, share_compensated

# Value, spread and interpretation of ours.
_Ours = tuple[float, float, str]
# Robot and quantity that the study has a parameter for, chosen to meet it.
FITTED = ("kuka_extended", "deviation_mean")
_TABLE4 = {"k_sigma_20": "k_sigma_20_percent", "dev_20": "dev_20_um"}


@dataclass(frozen=True)
class OurResults:
    """Everything that a printed figure may be compared with.

    `tables`: table1 .. table4 and extended. `metrics`, `replicates`: long; of all robots and strategies. `length`: noise level
    and data set length of the tables.
    """

    tables: dict[str, pd.DataFrame]
    metrics: pd.DataFrame
    replicates: pd.DataFrame
    noise_um: float
    length: int


class _PrintedFigure(NamedTuple):
    """A row of the reference table."""

    table: str
    robot: str
    strategy: str
    quantity: str
    unit: str
    value: float


def beside_paper(reference: pd.DataFrame, ours: OurResults) -> pd.DataFrame:
    """One row for each figure that the paper prints.

    `reference`: table, robot, strategy, quantity, unit, value as printed; empty strings where a figure belongs to none. Returns
    table, robot, strategy, quantity, unit, paper, ours, mc_std, z, interpretation: `mc_std` is the standard deviation between
    studies of this size, by bootstrap over data sets and test configurations; z = (ours - paper) / mc_std, empty where one is
    missing. What the study does not cover is empty.
    """
    rows = []
    printed = reference[[*_PrintedFigure._fields]].itertuples(index=False, name=None)
    for figure in map(_PrintedFigure._make, printed):
        text = figure.table == "text"
        value, spread, interpretation = _TEXT[figure.quantity](ours) if text else _RULES[figure.table](figure, ours)
        z = (value - figure.value) / spread if spread > 0 and np.isfinite(value) else np.nan
        rows.append((*figure, value, spread, z, interpretation))
    return pd.DataFrame(rows, columns=[*_PrintedFigure._fields[:-1], "paper", "ours", "mc_std", "z", "interpretation"])


def _table1_figure(figure: _PrintedFigure, ours: OurResults) -> _Ours:
    return _pair(ours.tables["table1"], figure.quantity, robot=figure.robot)[0], 0.0, "R1: an input"


def _table2_figure(figure: _PrintedFigure, ours: OurResults) -> _Ours:
    remark = "R11: the tube was chosen for it" if (figure.robot, figure.quantity) == FITTED else "R3"
    return *_pair(ours.tables["table2"], f"{figure.quantity.removeprefix('deviation_')}_mm", robot=figure.robot), remark


def _table3_figure(figure: _PrintedFigure, ours: OurResults) -> _Ours:
    return *_pair(ours.tables["table3"], figure.quantity, robot=figure.robot), "R7"


def _table4_figure(figure: _PrintedFigure, ours: OurResults) -> _Ours:
    table, key = ours.tables["table4"], {"strategy": figure.strategy, "robot": figure.robot}
    column = _TABLE4.get(figure.quantity, figure.quantity)
    if "k_sigma" not in column:
        return *_pair(table, column, **key), "R8"
    whole, first = _pair(table, column, **key), _pair(table, f"{column}_fixed_joints", **key)
    return *first, "R7" if first == whole else "R7, R10: joints fixed in the last stage"


def _largest_residual(ours: OurResults) -> _Ours:
    extended = ours.tables["extended"]
    if extended.empty:
        return np.nan, np.nan, ""
    worst = extended.iloc[extended.residual_mean_um.argmax()]
    return worst.residual_mean_um, worst.residual_mean_um_std_error, "R11: largest of all strategies; the paper prints a bound"


def _share_with_links(ours: OurResults) -> _Ours:
    row = _pair(ours.tables["extended"], "share_compensated_percent", strategy="6DoF")
    return *row, "R11, strategy 6DoF"


def _share_without_links(ours: OurResults) -> _Ours:
    return *share_compensated(ours.metrics, ours.replicates, "kuka", "6DoF", ours.noise_um, ours.length), "kuka, strategy 6DoF"


def _smallest_ratio(ours: OurResults) -> _Ours:
    ratios = []
    for _, cells in ours.tables["table4"].groupby("robot", sort=True):
        best = cells.iloc[cells[f"dev_{ours.length}_um"].argmin()]
        ratios.append(
            deviation_ratio(ours.metrics, ours.replicates, best.robot, "6DoF", best.strategy, ours.noise_um, ours.length)
        )
    return *min(ratios), "R8: the best strategy of each robot, the smaller robot ratio"


_RULES = {"1": _table1_figure, "2": _table2_figure, "3": _table3_figure, "4": _table4_figure}
_TEXT = {
    "residual_deviation_upper_bound": _largest_residual,
    "share_compensated_with_link_elasticity": _share_with_links,
    "share_compensated_joint_elasticity_only": _share_without_links,
    "best_over_6DoF_dev_ratio_min": _smallest_ratio,
}


def _pair(table: pd.DataFrame, column: str, **key: str) -> tuple[float, float]:
    """Value and standard error of one cell; not a number where the table lacks it."""
    rows = table
    for name, value in key.items():
        rows = rows[rows[name] == value]
    if rows.empty or column not in rows:
        return np.nan, np.nan
    return float(rows[column].iloc[0]), float(rows.get(f"{column}_std_error", pd.Series(0.0, rows.index)).iloc[0])
