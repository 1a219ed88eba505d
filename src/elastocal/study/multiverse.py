"""The multiverse of the paper's open points [1]: the alternative to each interpretation,
and its effect on every printed figure.

Alternatives that change the simulation (R2 to R6) have studies of their own, with the
random numbers of the first further studies, so that effects are paired. Alternatives of
scoring (R7, R8, R10, R13, R14) use the same studies.

References
----------
.. [1] Steegen, S., Tuerlinckx, F., Gelman, A. and Vanpaemel, W., Increasing transparency
   through a multiverse analysis, Perspectives on Psychological Science 11, 2016.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from elastocal.io.data_frames import read_frame, read_robot_tables
from elastocal.io.storage import write_table
from elastocal.study.in_memory import load_study
from elastocal.study.jobs import (
    Job,
    collect_provenance,
    read_frames,
    read_printed_figures,
    write_csvs,
)
from elastocal.study.joint_test import (
    JOINT_COUNTS,
    StudyReading,
    collect_study_values,
    list_tested_figures,
)
from elastocal.study.metrics import extrapolate_first_length
from elastocal.study.repeated import write_studies
from elastocal.study.schemas import INITIAL, REPEATED
from elastocal.study.simulation import summarize_displacements

if TYPE_CHECKING:
    from collections.abc import Sequence

    from elastocal.io.data_frames import Frames

# Data sets behind Table 2 of an interpretation.
_TABLE2_SETS = 100
# A change that a reader of a table would notice.
_NOTICEABLE_PERCENT = 5.0
_HEADS = ["table", "robot", "strategy", "quantity"]


@dataclass(frozen=True)
class Universe:
    """The alternative to one interpretation.

    Attributes
    ----------
    number : str
        Of the interpretation, R1 ...
    studies : DataFrame
        Robot and the columns of the table of repeated studies.
    initial
        The initial table of each robot.
    reading : StudyReading
        How studies are scored.
    """

    number: str
    studies: pd.DataFrame
    initial: Frames
    reading: StudyReading


def list_scorings(usual: Universe) -> list[Universe]:
    """List the alternative scorings of the studies of our interpretations."""
    studies = usual.studies
    initial = usual.initial
    reading = usual.reading
    averaged = studies.assign(
        k_sigma_fixed_joints=studies.k_sigma_fixed_joints_mean_compliance,
        deviation=studies.deviation_mean_compliance,
    )
    single = studies.assign(deviation=np.sqrt(studies.mean_square))
    all_joints = replace(reading, k_sigma=JOINT_COUNTS["all joints"])
    pooled = {robot: _pool(frame) for robot, frame in initial.items()}
    first = replace(reading, find_length=extrapolate_first_length)
    return [
        Universe("R7", averaged, initial, reading),
        Universe("R8", single, initial, reading),
        Universe("R10", studies, initial, all_joints),
        Universe("R13", studies, pooled, reading),
        Universe("R14", studies, initial, first),
    ]


def _pool(initial: pd.DataFrame) -> pd.DataFrame:
    """The initial table as if every data set had all configurations."""
    pooled = initial[["mean", "mean_square"]].mean()
    columns = {**pooled, "maximum": initial.maximum.max()}
    return pd.DataFrame({name: [value] for name, value in columns.items()}).loc[
        np.zeros(len(initial), int)
    ]


def build_multiverse_table(
    printed: pd.DataFrame, usual: Universe, others: Sequence[Universe]
) -> pd.DataFrame:
    """Compare every printed figure with its value by our interpretations, and by the
    alternative to one of them.

    Parameters
    ----------
    printed
        The tested figures.
    usual
        The studies by our interpretations.
    others
        Each may have fewer studies, the first ones.

    Returns
    -------
    DataFrame
        Number of the interpretation, heads of the figure; paper, ours and other (medians
        over the studies that both have), and the share by which the alternative changes
        ours, in percent, paired by study. Only figures that both have.
    """
    rows = []
    all_ours = _collect(printed, usual)
    for universe in others:
        alternative = _collect(printed, universe)
        ours = all_ours[: len(alternative)]
        covered = ~(np.isnan(alternative) | np.isnan(ours)).any(axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            change = 100 * (np.median(alternative / ours, axis=0) - 1)
        figure: Any
        for index, figure in enumerate(printed.itertuples()):
            if covered[index]:
                heads = [getattr(figure, name) for name in _HEADS]
                medians = [float(np.median(v[:, index])) for v in (ours, alternative)]
                rows.append(
                    (universe.number, *heads, figure.value, *medians, change[index])
                )
    columns = ["interpretation", *_HEADS, "paper", "ours", "other", "change_percent"]
    return pd.DataFrame(rows, columns=columns)


def _collect(printed: pd.DataFrame, universe: Universe) -> np.ndarray:
    return collect_study_values(
        printed, universe.studies, universe.initial, universe.reading
    )


def summarize_multiverse(
    table: pd.DataFrame, interpretations: pd.DataFrame
) -> pd.DataFrame:
    """Summarize the multiverse, a row for each interpretation.

    Parameters
    ----------
    table
        From `build_multiverse_table`.
    interpretations
        With number, open, interpretation, alternative and the figures it was chosen on.

    Returns
    -------
    DataFrame
        Number of figures that change by over 5 %; the median factor between the paper
        and ours, and between the paper and the alternative, over the figures that change;
        empty if no alternative can be computed.
    """
    rows = []
    for number in interpretations.number:
        cell = table[(table.interpretation == number)]
        changed = cell[cell.change_percent.abs() > _NOTICEABLE_PERCENT]
        factors = {
            name: float(np.exp(np.log(changed[name] / changed.paper).abs().median()))
            for name in ("ours", "other")
        }
        rows.append((len(cell), len(changed), factors["ours"], factors["other"]))
    columns = ["figures", "changed", "factor_ours", "factor_other"]
    summary = pd.DataFrame(rows, interpretations.index, columns)
    return interpretations.join(summary)


def evaluate_alternative(job: Job) -> None:
    """Evaluate the first further studies of one robot under another interpretation, and
    its deflections before calibration."""
    study = load_study(job)
    write_studies(job, study)
    sets = np.arange(_TABLE2_SETS)
    experiments = study.draw_experiments(sets)
    deflections = study.compute_deflections(experiments)
    columns = {
        "data_set": sets,
        "configurations": np.full(len(sets), deflections.shape[1]),
        **summarize_displacements(deflections),
    }
    write_table(job.output.initial, INITIAL, [columns], collect_provenance(job))


def tabulate_multiverse(job: Job) -> None:
    """Write the multiverse and its summary."""
    params = job.params
    printed = list_tested_figures(read_printed_figures(job.input.reference))
    reading = StudyReading(params.length)
    usual = Universe(
        "ours",
        read_robot_tables(job.input.studies, REPEATED),
        read_frames(job, job.input.initial, INITIAL),
        reading,
    )
    alternatives = []
    # The files have the order of the interpretations and their robots.
    files = zip(job.input.alternatives, job.input.alternatives_initial, strict=True)
    for number, robots in params.alternatives.items():
        studies, initial = zip(*(next(files) for _ in robots), strict=True)
        frames = [read_frame(path, INITIAL) for path in initial]
        alternatives.append(
            Universe(
                number,
                read_robot_tables(studies, REPEATED),
                dict(zip(robots, frames, strict=True)),
                reading,
            )
        )
    table = build_multiverse_table(
        printed, usual, [*alternatives, *list_scorings(usual)]
    )
    interpretations = pd.read_csv(job.input.interpretations)
    write_csvs(job, table=table, summary=summarize_multiverse(table, interpretations))
