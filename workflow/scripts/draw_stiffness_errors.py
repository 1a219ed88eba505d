"""Figures 5a and 5b: summed stiffness error of all strategies."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import stiffness_errors
from elastocal.figures.style import save
from elastocal.io.data_frames import read_long
from elastocal.study.evaluation import metrics


def draw_stiffness_errors(job: Job) -> None:
    settings = job.params
    frame, printed = read_long(job.input.metrics, metrics), pd.read_csv(job.input.reference, dtype={"table": str})
    save(
        stiffness_errors(frame, printed, settings.title, settings.robot, settings.order, settings.limit),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_stiffness_errors, snakemake)
