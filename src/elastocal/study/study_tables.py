"""Tables about many studies: expectations beside them, Table 4 over them, and what each interpretation of open points moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_long, read_studies
from elastocal.study.jobs import MICRO, Job, read_reference, write_csvs
from elastocal.study.metrics import length_to_reach
from elastocal.study.printed import LEVEL, holm, joint_table, predict_scatter, predicted_cells
from elastocal.study.repeated import expected, repeated
from elastocal.study.tables import add_slugs

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

# Quantities of the expectations table by the columns of scores, with the factor to their units and the printed figure.
_QUANTITIES = {
    "k_sigma_{}_percent": ("k_sigma", 1.0, ""),
    "k_sigma_{}_percent_fixed_joints": ("k_sigma_fixed_joints", 1.0, "k_sigma_{}"),
    "dev_{}_um": ("deviation", MICRO, "dev_{}"),
}
# Those of Table 4: name, column, factor, unit, key of the limit.
_FIGURES = (
    ("k_sigma", "k_sigma", 1.0, "percent", "k_sigma"),
    ("k_sigma_fixed_joints", "k_sigma_fixed_joints", 1.0, "percent", "k_sigma"),
    ("dev", "deviation", MICRO, "um", "deviation"),
)
# Groups of printed figures by the start of their quantity.
_GROUPS = {"c": "table_3", "k_sigma": "k_sigma", "dev_": "dev", "n_": "lengths"}


def expectations_table(
    studies: pd.DataFrame, expected: pd.DataFrame, reference: pd.DataFrame, length: int, strategies: Sequence[str]
) -> pd.DataFrame:
    """Expectation, further studies and the paper, side by side.

    `studies`: robot and the columns of `repeated.repeated`. `expected`: long, at the noise of the tables. `reference`: the
    printed figures. `length`: data set length of the scores. `strategies`: in the order of rows. Of the two counts of joints in
    k_sigma, the paper's figure is taken for that of the fixed joints (interpretation R10).
    """
    printed = reference[reference.table == "4"].set_index(["robot", "strategy", "quantity"]).value
    rows = []
    for robot in dict.fromkeys(studies.robot):
        for strategy in strategies:
            mine = studies[(studies.robot == robot) & (studies.strategy == strategy) & (studies.length == length)]
            there = expected[(expected.robot == robot) & (expected.strategy == strategy) & (expected.length == length)]
            if mine.empty or there.empty:
                continue
            for name, (column, factor, figure) in _QUANTITIES.items():
                values, cell = factor * mine[column], figure.format(length)
                paper = float(printed.get((robot, strategy, cell), np.nan))
                scatter = predict_scatter(studies, robot, strategy, cell, length) if np.isfinite(paper) else None
                p_value = scatter.p_value(paper) if scatter else np.nan
                head = (robot, strategy, name.format(length), factor * float(there[column].iloc[0]))
                rows.append((*head, len(values), values.mean(), values.std(ddof=1), paper, p_value))
    columns = ["robot", "strategy", "quantity", "expected"]
    return pd.DataFrame(rows, columns=[*columns, "studies", "studies_mean", "studies_std", "paper", "p_value"])


def measured_table(studies: Mapping[str, pd.DataFrame], length: int, limits: Mapping[str, float]) -> pd.DataFrame:
    """Table 4 over studies, by what is measured and by what is averaged (stiffness or compliance).

    `studies`: by what is measured. `limits`: k_sigma in percent and deviation in µm whose lengths are given. Each figure is the
    median over studies (of positions of one reflector the mean of 1/ĉ need not exist) with a robust standard deviation between
    them (1.4826 times the median absolute deviation); rms: of one data set.
    """
    rows = []
    for measured, frame in studies.items():
        for (robot, strategy), cell in frame.groupby(["robot", "strategy"], sort=False):
            for average, end in (("stiffness", ""), ("compliance", "_mean_compliance")):
                row: dict[str, Any] = {"robot": robot, "strategy": strategy, "measured": measured, "average": average}
                for name, column, factor, unit, key in _FIGURES:
                    curves = factor * cell.pivot(index="study", columns="length", values=f"{column}{end}").to_numpy()
                    row |= _middle(f"{name}_{length}_{unit}", curves[:, length - 1])
                    row |= _middle(f"n_{name}_{limits[key]:g}_{unit}", length_to_reach(curves, limits[key]))
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

    `studies`: by interpretation. `usual`: the one that is configured. `classical`: strategy whose scores are shown. One row for
    each interpretation, and one for the other count of joints in k_sigma (R10): the scores of the classical strategy on each
    robot, mean over studies; the sum of log predictive densities of the printed figures over that of the usual interpretation,
    in all (with its standard error) and by group; cells and how many of them differ after Holm's correction. Figures of one
    robot move together, so that the sums order interpretations and are no probabilities.
    """
    found = [(name, frame, True) for name, frame in studies.items()]
    found.append(("R10_all_joints", studies[usual], False))
    made = [_of_interpretation(name, frame, reference, length, first, classical) for name, frame, first in found]
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
    for scatter, value, quantity in predicted_cells(printed, studies, length, fixed_joints):
        totals[next(group for start, group in _GROUPS.items() if quantity.startswith(start))] += scatter.log_density(value)
        p_values.append(scatter.p_value(value))
        deleted += [others.log_density(value) for others in scatter.leave_out_each()]
    row |= {f"log_likelihood_{group}": value for group, value in totals.items()}
    row["log_likelihood"] = sum(totals.values())
    return row | {"cells": len(p_values), "differ": int((holm(np.array(p_values)) < LEVEL).sum())}, deleted


def _by_interpretation(job: Job) -> dict[str, pd.DataFrame]:
    """Studies of each interpretation, whose name is that of the folder."""
    names = dict.fromkeys(Path(path).parent.name for path in job.input.studies)
    files = {name: [path for path in job.input.studies if Path(path).parent.name == name] for name in names}
    return {name: read_studies(paths, repeated) for name, paths in files.items()}


def tabulate_expectations(job: Job) -> None:
    """Expectations beside studies and the paper."""
    studies, expectations = read_studies(job.input.studies, repeated), read_long(job.input.expected, expected)
    reference = read_reference(job.input.reference)
    write_csvs(job, table=expectations_table(studies, expectations, reference, job.params.length, job.params.strategies))


def tabulate_studies(job: Job) -> None:
    """Table 4 over studies, and the joint test of the printed figures."""
    asked, studies = job.params, _by_interpretation(job)
    by_kind = {kind: studies[name] for name, kind in asked.measured.items()}
    joint = joint_table(studies[asked.usual], read_reference(job.input.reference), asked.length)
    write_csvs(job, table=add_slugs(measured_table(by_kind, asked.length, asked.limits), asked.slugs), joint=joint)


def tabulate_interpretations(job: Job) -> None:
    """Other interpretations of the paper."""
    asked, reference = job.params, read_reference(job.input.reference)
    write_csvs(job, table=interpretations_table(_by_interpretation(job), reference, asked.length, asked.usual, asked.classical))
