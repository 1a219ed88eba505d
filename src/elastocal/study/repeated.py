"""A study over again: how far a printed figure may lie from another one, and Table 4 over studies.

Further studies have data sets that no other one has, and nothing of these is kept.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elastocal.io.storage import TableSchema, write_table
from elastocal.study.evaluation import SCORES, average, score_columns
from elastocal.study.in_memory import study_of
from elastocal.study.jobs import (
    LENGTH,
    MICRO,
    STRATEGY,
    Job,
    add_slugs,
    origin,
    real,
    rows_as_frame,
    strategies_of,
    table,
    whole,
    write_csvs,
)
from elastocal.study.metrics import length_to_reach

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    import pandas as pd

    from elastocal.study.in_memory import StudyInMemory
    from elastocal.study.strategies import Strategy

# Those of Table 4: name, column, factor, unit, key of the limit.
_FIGURES = (
    ("k_sigma", "k_sigma", 1.0, "percent", "k_sigma"),
    ("k_sigma_fixed_joints", "k_sigma_fixed_joints", 1.0, "percent", "k_sigma"),
    ("dev", "deviation", MICRO, "um", "deviation"),
)


def repeated(joints: int) -> TableSchema:
    """Scores of further studies of the same size; one row for each study, strategy and length."""
    other = "by the mean of the compliances where the metrics have that of the stiffnesses"
    return table(
        "repeated",
        whole("study", "number of the study, from 1; that of the tables is number 0", 1),
        STRATEGY,
        LENGTH,
        *(real(f"compliance_{j}", "rad/(N m)", f"as in the metrics, of joint {j}", missing=True) for j in range(1, joints + 1)),
        *SCORES,
        real("k_sigma_mean_compliance", "percent", f"sum of delta_k over all joints, {other}", missing=True),
        real("k_sigma_fixed_joints_mean_compliance", "percent", f"the same of the fixed joints, {other}", missing=True),
        real("deviation_mean_compliance", "m", f"deviation {other}", missing=True),
        real("mean_square", "m^2", "mean square end-effector error of single data sets", missing=True),
    )


def repeated_blocks(
    study: StudyInMemory, studies: Iterable[int], strategies: Sequence[Strategy]
) -> Iterator[dict[str, np.ndarray | str]]:
    """Scores of studies of these numbers, block by block one strategy in one study."""
    robot, read, tests = study.robot, study.interpretation, np.ones((1, study.size.tests))
    for number in studies:
        judge, found = study.judge(number), study.estimates(strategies, number)
        for strategy in strategies:
            blocks = [(compliance, np.ones((1, len(compliance)))) for compliance in found[strategy.name]]
            averages = average(blocks, judge, read.average, tests)
            plain = average(blocks, judge, "compliance", tests)
            fixed = strategy.fixed_joints
            others = score_columns(plain.compliance[0], plain.deviation[0], robot.compliance, fixed)
            squares = [judge.mean_square(np.moveaxis(each, 0, -1)) for each, _ in blocks]
            yield {
                "length": np.arange(1, len(squares[0]) + 1),
                **{f"compliance_{j + 1}": column for j, column in enumerate(averages.compliance[0].T)},
                **score_columns(averages.compliance[0], averages.deviation[0], robot.compliance, fixed),
                **{f"{name}_mean_compliance": values for name, values in others.items()},
                "mean_square": np.concatenate(squares, axis=1).mean(axis=1),
                "study": np.full(len(squares[0]), number),
                "strategy": strategy.name,
            }


def over_studies_table(studies: pd.DataFrame, length: int, limits: Mapping[str, float]) -> pd.DataFrame:
    """Table 4 over studies, by what is averaged (stiffness or compliance).

    `studies`: robot and the columns of `repeated`. `limits`: k_sigma in percent and deviation in µm whose lengths are given.
    Each figure is the median over studies with a robust standard deviation between them (1.4826 times the median absolute
    deviation); rms: of one data set.
    """
    rows = []
    for (robot, strategy), cell in studies.groupby(["robot", "strategy"], sort=False):
        for averaged, end in (("stiffness", ""), ("compliance", "_mean_compliance")):
            row: dict[str, Any] = {"robot": robot, "strategy": strategy, "average": averaged}
            for name, column, factor, unit, key in _FIGURES:
                curves = factor * cell.pivot(index="study", columns="length", values=f"{column}{end}").to_numpy()
                row |= _middle(f"{name}_{length}_{unit}", curves[:, length - 1])
                row |= _middle(f"n_{name}_{limits[key]:g}_{unit}", length_to_reach(curves, limits[key]))
            rows.append(row | _middle(f"rms_{length}_um", MICRO * np.sqrt(cell.mean_square[cell.length == length])))
    return rows_as_frame(rows)


def _middle(name: str, values: np.ndarray | pd.Series) -> dict[str, float]:
    """Median, and a standard deviation that outlying studies do not move."""
    middle = float(np.median(values))
    return {name: middle, f"{name}_std": float(1.4826 * np.median(np.abs(values - middle)))}


def repeat_studies(job: Job) -> None:
    """Further studies of one robot."""
    study = study_of(job)
    blocks = repeated_blocks(study, range(1, job.params.studies + 1), strategies_of(job))
    write_table(job.output.repeated, repeated(study.robot.joints), blocks, origin(job))


def tabulate_studies(job: Job) -> None:
    """Table 4 over studies."""
    from elastocal.io.data_frames import read_long

    asked = job.params
    found = over_studies_table(read_long(job.input.studies, repeated), asked.length, asked.limits)
    write_csvs(job, table=add_slugs(found, asked.slugs))
