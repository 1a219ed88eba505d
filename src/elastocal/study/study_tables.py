"""Tables about many studies: expectations beside them, and what each interpretation of the paper's open points moves."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from elastocal.study.metrics import length_to_reach
from elastocal.study.printed import LEVEL, MICRO, holm, predict_scatter

# Quantities of the expectations table by the columns of scores, with the factor to their units.
_QUANTITIES = {
    "k_sigma_{}_percent": ("k_sigma", 1.0),
    "k_sigma_{}_percent_fixed_joints": ("k_sigma_fixed_joints", 1.0),
    "dev_{}_um": ("deviation", MICRO),
}
# Groups of printed figures by the start of their quantity.
_GROUPS = {"c": "table_3", "k_sigma": "k_sigma", "dev_": "dev", "n_": "lengths"}


def expectations_table(
    studies: pd.DataFrame, expected: pd.DataFrame, reference: pd.DataFrame, length: int, strategies: Sequence[str]
) -> pd.DataFrame:
    """Expectation, further studies and the paper, side by side.

    `studies`: robot and the columns of `table_schemas.repeated`. `expected`: long, of `table_schemas.expected`, at the noise of
    the tables. `reference`: the printed figures. `length`: data set length of the scores. `strategies`: in the order of rows.
    Returns robot, strategy, quantity, expected, studies, studies_mean, studies_std, paper, p_value. Of the two counts of joints
    in k_sigma, the paper's figure is taken for that of the fixed joints (interpretation R10).
    """
    printed = reference[reference.table == "4"].set_index(["robot", "strategy", "quantity"]).value
    rows = []
    for robot in dict.fromkeys(studies.robot):
        for strategy in strategies:
            mine = studies[(studies.robot == robot) & (studies.strategy == strategy) & (studies.length == length)]
            there = (expected.robot == robot) & (expected.strategy == strategy) & (expected.length == length)
            if mine.empty or not there.any():
                continue
            for name, (column, factor) in _QUANTITIES.items():
                values = factor * mine[column]
                row: dict[str, Any] = {"robot": robot, "strategy": strategy, "quantity": name.format(length)}
                row["expected"] = factor * float(expected[there][column].iloc[0])
                row |= {"studies": len(values), "studies_mean": values.mean(), "studies_std": values.std(ddof=1)}
                cell = {"k_sigma_fixed_joints": f"k_sigma_{length}", "deviation": f"dev_{length}"}.get(column, "")
                row["paper"] = float(printed.get((robot, strategy, cell), np.nan))
                scatter = predict_scatter(studies, robot, strategy, cell, length) if np.isfinite(row["paper"]) else None
                row["p_value"] = scatter.p_value(row["paper"]) if scatter else np.nan
                rows.append(row)
    names = ["robot", "strategy", "quantity", "expected", "studies", "studies_mean", "studies_std", "paper", "p_value"]
    return pd.DataFrame(rows, columns=names)


def measured_table(studies: Mapping[str, pd.DataFrame], length: int, limits: Mapping[str, float]) -> pd.DataFrame:
    """Table 4 as the mean over studies, by what is measured and by what is averaged.

    `studies`: by what is measured; robot and the columns of `table_schemas.repeated`. `length`: of the scores. `limits`:
    k_sigma in percent and deviation in µm whose lengths are given. Returns robot, strategy, measured, average (stiffness or
    compliance), and each figure of Table 4 as its median over studies (of positions of one reflector the mean of 1/ĉ need not
    exist) with the standard deviation between studies, robust (1.4826 times the median absolute deviation); k_sigma over all
    joints and over those fixed in the last stage; rms_{length}_um of one data set.
    """
    rows = []
    for measured, frame in studies.items():
        for (robot, strategy), cell in frame.groupby(["robot", "strategy"], sort=False):
            for average, end in (("stiffness", ""), ("compliance", "_mean_compliance")):
                row: dict[str, Any] = {"robot": robot, "strategy": strategy, "measured": measured, "average": average}
                for name, column, factor, unit in (
                    ("k_sigma", "k_sigma", 1.0, "percent"),
                    ("k_sigma_fixed_joints", "k_sigma_fixed_joints", 1.0, "percent"),
                    ("dev", "deviation", MICRO, "um"),
                ):
                    curves = factor * cell.pivot(index="study", columns="length", values=f"{column}{end}").to_numpy()
                    row |= _middle(f"{name}_{length}_{unit}", curves[:, length - 1])
                    limit = limits[column.removesuffix("_fixed_joints")]
                    row |= _middle(f"n_{name}_{limit:g}_{unit}", length_to_reach(curves, limit))
                rows.append(row | _middle(f"rms_{length}_um", MICRO * np.sqrt(cell.mean_square[cell.length == length])))
    return pd.DataFrame(rows)


def _middle(name: str, values: np.ndarray | pd.Series) -> dict[str, float]:
    """Median, and a standard deviation that outlying studies do not move."""
    middle = float(np.median(values))
    return {name: middle, f"{name}_std": float(1.4826 * np.median(np.abs(values - middle)))}


def interpretations_table(
    studies: Mapping[str, pd.DataFrame], reference: pd.DataFrame, length: int, usual: str, classical: str
) -> pd.DataFrame:
    """What each interpretation moves, and how well it predicts the printed figures of Tables 3 and 4.

    `studies`: by interpretation; robot and the columns of `table_schemas.repeated`. `reference`: the printed figures. `length`:
    data set length of the tables. `usual`: the interpretation as it is configured, among `studies`. `classical`: strategy whose
    scores are shown. Returns one row for each interpretation, and one for the other count of joints in k_sigma (R10): the
    scores of the classical strategy on each robot, mean over studies; the sum of log predictive densities of the printed
    figures over that of the usual interpretation, in all (with its standard error) and by group; cells and how many of them
    differ after Holm's correction. Figures of one robot move together, so that the sums order interpretations and are no
    probabilities.
    """
    printed = reference[reference.table.isin(["3", "4"])]
    found = [(name, frame, True) for name, frame in studies.items()]
    found.append(("R10_all_joints", studies[usual], False))
    made = [_of_interpretation(name, frame, printed, length, first, classical) for name, frame, first in found]
    base, base_deleted = made[[*studies].index(usual)]
    rows = []
    for row, deleted in made:
        # Jackknife over studies, of which the interpretations have the same configurations and noise.
        difference = deleted - base_deleted
        error = np.sqrt((len(difference) - 1) * difference.var())
        relative = {key: value - base[key] if key.startswith("log_") else value for key, value in row.items()}
        rows.append(relative | {"log_likelihood_std_error": error})
    return pd.DataFrame(rows)


def _of_interpretation(
    name: str, studies: pd.DataFrame, printed: pd.DataFrame, length: int, fixed_joints: bool, classical: str
) -> tuple[dict[str, Any], np.ndarray]:
    """The row of an interpretation, and its log likelihood without each of the studies."""
    row: dict[str, Any] = {"interpretation": name}
    for robot in dict.fromkeys(studies.robot):
        at = studies[(studies.robot == robot) & (studies.strategy == classical) & (studies.length == length)]
        row[f"k_sigma_{length}_percent_{robot}"] = at.k_sigma.mean()
        row[f"dev_{length}_um_{robot}"] = MICRO * at.deviation.mean()
    totals: dict[str, float] = dict.fromkeys(_GROUPS.values(), 0.0)
    p_values, deleted = [], np.zeros(studies.study.nunique())
    cells = printed[["robot", "strategy", "quantity"]].itertuples(index=False, name=None)
    for (robot, strategy, quantity), value in zip(cells, printed.value, strict=True):
        scatter = predict_scatter(studies, robot, strategy, quantity, length, fixed_joints)
        if scatter is not None:
            group = next(group for start, group in _GROUPS.items() if quantity.startswith(start))
            totals[group] += scatter.log_density(value)
            p_values.append(scatter.p_value(value))
            deleted += [others.log_density(value) for others in scatter.leave_out_each()]
    row |= {f"log_likelihood_{group}": value for group, value in totals.items()}
    row["log_likelihood"] = sum(totals.values())
    return row | {"cells": len(p_values), "differ": int((holm(np.array(p_values)) < LEVEL).sum())}, deleted
