"""The paper's printed figures among further studies of the same size: one by one and
jointly.

If the paper is one more draw of the simulation, it and the k further studies are
exchangeable. All tests follow from this alone, so that neither the distribution of a
figure (means of 1/c have no finite variance) nor the dependence of the figures matters:

- The p value of one figure is the rank of the printed value among the studies, two-sided.
- A figure's distance is that from the median, over the half width of the central 68 % on
  its side. The largest distance of a member over all figures is the statistic of the
  family; its rank among the members is the joint p value, and the step-down procedure
  [1] with these maxima corrects the distances for the number of figures.
- The number of figures with a p value below the level is a second joint statistic.

No p value is smaller than 1/(k + 1) [2]. A printed figure is rounded. It is replaced by
the value within its rounding that is closest to the median of the studies, which favours
the paper.

Each figure has an interval within which it does not differ from the studies at the level
of the whole family; differences within it cannot be detected.

References
----------
.. [1] Westfall, P. H. and Young, S. S., Resampling-Based Multiple Testing, Wiley, 1993.
.. [2] Barnard, G. A., discussion of The spectral analysis of point processes, Journal of
   the Royal Statistical Society B 25, 1963.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

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
from elastocal.study.printed import FITTED
from elastocal.study.schemas import INITIAL, REPEATED
from elastocal.study.simulation import compute_statistics

# Level of the tests of one figure and of the whole family.
SIGNIFICANCE_LEVEL = 0.05
# Last printed digit, by the first letters of a quantity.
_LAST_DIGITS = {
    "c": 1e-3,
    "k_sigma": 1e-3,
    "dev_": 1e-3,
    "deviation": 1e-3,
    "n_": 1.0,
}
# A normal distribution has this share within one standard deviation.
_CENTRAL_SHARE = 0.6827
# The counts of joints in k_sigma (interpretation R10), by the column of the studies.
JOINT_COUNTS = {"fixed joints": "k_sigma_fixed_joints", "all joints": "k_sigma"}


@dataclass(frozen=True)
class StudyReading:
    """How the printed figures are read from studies.

    Attributes
    ----------
    length : int
        Data set length of Table 3.
    k_sigma : str
        Column of the studies for k_sigma (interpretation R10).
    find_length : callable
        Length at which scores (studies, lengths) are within a limit (R14).
    """

    length: int
    k_sigma: str = JOINT_COUNTS["fixed joints"]
    find_length: Callable[[np.ndarray, float], np.ndarray] = extrapolate_length


def list_tested_figures(printed: pd.DataFrame) -> pd.DataFrame:
    """List the printed figures that studies of the same size can judge: those of Tables
    2, 3 and 4, without the one that the study was fitted to.

    Table 1 is an input, and the text states bounds and figures of Table 4 again.
    """
    is_fitted = (printed.robot == FITTED[0]) & (printed.quantity == FITTED[1])
    return printed[printed.table.isin(["2", "3", "4"]) & ~is_fitted]


def pivot_studies(studies: pd.DataFrame) -> dict[tuple[str, str], pd.DataFrame]:
    """Arrange the table of repeated studies by robot and strategy: a row for each study,
    and a column for each score and length."""
    groups = studies.groupby(["robot", "strategy"], sort=False)
    return {
        (str(robot), str(strategy)): cell.pivot(index="study", columns="length")
        for (robot, strategy), cell in groups
    }


def collect_study_values(
    figures: pd.DataFrame,
    studies: pd.DataFrame,
    initial: Frames,
    reading: StudyReading,
) -> np.ndarray:
    """Collect the value of every printed figure in every study.

    Parameters
    ----------
    figures
        Printed figures with their heads.
    studies
        Robot and the columns of the table of repeated studies.
    initial
        The initial table of each robot; a study's Table 2 is that of one of its data
        sets (interpretation R13).
    reading

    Returns
    -------
    (studies, figures) array
        In the printed units; NaN for figures that the studies lack.
    """
    numbers = np.unique(studies.study)
    values = np.full((len(numbers), len(figures)), np.nan)
    cells = pivot_studies(studies)
    figure: Any
    for index, figure in enumerate(figures.itertuples()):
        cell = cells.get((figure.robot, figure.strategy))
        if figure.table == "2" and figure.robot in initial:
            statistics = compute_statistics(initial[figure.robot])
            by_set = statistics[figure.quantity.removeprefix("deviation_")]
            of_studies = MILLI * by_set.to_numpy()[: len(numbers)]
            values[: len(of_studies), index] = of_studies
        elif figure.table != "2" and cell is not None:
            values[:, index] = _read_quantity(cell, figure.quantity, reading)
    return values


def join_members(printed: pd.DataFrame, values: np.ndarray) -> np.ndarray:
    """Put the paper before the studies, (1 + studies, figures), with the values within the
    rounding of the printed figures that are closest to the medians of the studies."""
    digits = np.array([_find_digit(quantity) for quantity in printed.quantity])
    value = printed.value.to_numpy(float)
    median = np.median(values, axis=0)
    closest = np.clip(median, value - digits / 2, value + digits / 2)
    return np.vstack([closest, values])


def _find_digit(quantity: str) -> float:
    return next(
        digit for start, digit in _LAST_DIGITS.items() if quantity.startswith(start)
    )


def _read_quantity(
    cell: pd.DataFrame, quantity: str, reading: StudyReading
) -> np.ndarray:
    """Values (studies,) of a quantity of Table 3 or 4, from a table with a column for
    each score and length."""
    if quantity[1:].isdigit():
        return MICRO * cell[f"compliance_{quantity[1:]}"][reading.length].to_numpy()
    column, scale = (
        ("deviation", MICRO) if "dev" in quantity else (reading.k_sigma, 1.0)
    )
    scores = scale * cell[column].to_numpy()
    if quantity.startswith("n_"):
        return reading.find_length(scores, float(quantity.split("_")[-2]))
    return scores[:, int(quantity.rpartition("_")[2]) - 1]


def rank_two_sided(members: np.ndarray) -> np.ndarray:
    """Two-sided p values (members, figures) by the rank of each member among all."""
    count = len(members)
    ordered = np.sort(members, axis=0)
    p_values = np.empty(members.shape)
    for column, (values, among) in enumerate(zip(members.T, ordered.T, strict=True)):
        at_most = np.searchsorted(among, values, side="right")
        at_least = count - np.searchsorted(among, values, side="left")
        p_values[:, column] = 2 * np.minimum(at_most, at_least) / count
    return np.minimum(p_values, 1.0)


def measure_distances(
    members: np.ndarray,
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Distances (members, figures) from the median, in half widths of the central 68 %
    on the member's side.

    Also returns the medians and the half widths below and above, (figures,) each.
    """
    tail = (1 - _CENTRAL_SHARE) / 2
    low, median, high = np.quantile(members, [tail, 0.5, 1 - tail], axis=0)
    # Whole lengths may all lie on one side of the median.
    smallest = 1e-9 * np.abs(median) + np.finfo(float).tiny
    below = np.maximum(median - low, smallest)
    above = np.maximum(high - median, smallest)
    difference = members - median
    distances = np.where(difference > 0, difference / above, -difference / below)
    return distances, (median, below, above)


def correct_step_down(distances: np.ndarray) -> np.ndarray:
    """Correct the distances of the first member for the number of figures by the
    step-down procedure of Westfall and Young.

    Parameters
    ----------
    distances : (members, figures) array

    Returns
    -------
    (figures,) array
        Corrected p values.
    """
    order = np.argsort(-distances[0])
    # Largest distance over the figures that are not yet decided.
    ordered = distances[:, order[::-1]]
    largest = np.maximum.accumulate(ordered, axis=1)[:, ::-1]
    p_values = (largest >= distances[0, order]).mean(axis=0)
    corrected = np.empty(len(order))
    corrected[order] = np.maximum.accumulate(p_values)
    return corrected


def build_comparison_table(
    compared: pd.DataFrame, printed: pd.DataFrame, values: np.ndarray
) -> pd.DataFrame:
    """Judge the printed figures by further studies.

    Parameters
    ----------
    compared
        From `printed.compare_figures`, in the order of the printed figures.
    printed
        The tested figures, a part of them.
    values : (studies, figures) array
        From `collect_study_values`.

    Returns
    -------
    DataFrame
        `compared` with the studies' median, their central 95 %, the values that the
        family could not have distinguished from the studies, and the p value of the figure alone
        and corrected. Empty for figures that are not tested.
    """
    judged = pd.DataFrame(index=printed.index, columns=_JUDGED, dtype=float)
    covered = ~np.isnan(values).any(axis=0) & (len(values) > 1)
    if covered.any():
        studies = values[:, covered]
        members = join_members(printed[covered], studies)
        distances, (median, below, above) = measure_distances(members)
        critical = np.quantile(
            distances.max(axis=1), 1 - SIGNIFICANCE_LEVEL, method="higher"
        )
        tail = SIGNIFICANCE_LEVEL / 2
        low, high = np.quantile(studies, [tail, 1 - tail], axis=0)
        columns = (
            *(np.median(studies, axis=0), low, high),
            *(median - critical * below, median + critical * above),
            *(rank_two_sided(members)[0], correct_step_down(distances)),
        )
        judged.loc[covered] = np.column_stack(columns)
    return compared.join(judged)


_JUDGED = [
    *("studies_median", "studies_low", "studies_high"),
    *("unseen_low", "unseen_high"),
    *("p_value", "p_corrected"),
]


def build_joint_row(printed: pd.DataFrame, values: np.ndarray) -> dict[str, Any]:
    """Test all figures jointly.

    Returns
    -------
    dict
        figures, studies; largest_distance and below (the number of p values below the
        level), each of the paper, with the median and the largest of the studies and the
        p value by rank; differ: figures that differ after the correction.
    """
    covered = ~np.isnan(values).any(axis=0)
    row: dict[str, Any] = {
        "figures": int(covered.sum()),
        "studies": len(values),
    }
    if not covered.any():
        # The paper prints no figures of these robots and strategies.
        nothing = np.full(2, np.nan)
        ranks = _rank_first("largest_distance", nothing) | _rank_first("below", nothing)
        return row | {"differ": 0} | dict.fromkeys(ranks, np.nan)
    members = join_members(printed[covered], values[:, covered])
    distances, _ = measure_distances(members)
    below = (rank_two_sided(members) < SIGNIFICANCE_LEVEL).sum(axis=1)
    differ = correct_step_down(distances) < SIGNIFICANCE_LEVEL
    return (
        row
        | {"differ": int(differ.sum())}
        | _rank_first("largest_distance", distances.max(axis=1))
        | _rank_first("below", below)
    )


def _rank_first(name: str, statistic: np.ndarray) -> dict[str, float]:
    """A statistic of the first member with its p value by rank among all members."""
    return {
        name: float(statistic[0]),
        f"{name}_studies_median": float(np.median(statistic[1:])),
        f"{name}_studies_largest": float(statistic[1:].max()),
        f"{name}_p": float((statistic >= statistic[0]).mean()),
    }


def compare_with_studies(job: Job) -> None:
    """Write every printed figure among further studies, and the joint test."""
    compared = pd.read_csv(job.input.beside, dtype={"table": str})
    initial = read_frames(job, job.input.initial, INITIAL)
    studies = read_robot_tables(job.input.studies, REPEATED)
    figures = list_tested_figures(read_printed_figures(job.input.reference))
    rows = []
    for joints, column in JOINT_COUNTS.items():
        reading = StudyReading(job.params.length, column)
        values = collect_study_values(figures, studies, initial, reading)
        if joints == "fixed joints":
            table = build_comparison_table(compared, figures, values)
        rows.append({"joints": joints, **build_joint_row(figures, values)})
    write_csvs(job, table=table, joint=pd.DataFrame(rows))
