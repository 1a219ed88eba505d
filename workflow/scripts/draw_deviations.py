"""Figures 5c and 5d: deviation of all strategies."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import deviations
from elastocal.figures.style import save
from elastocal.io.data_frames import read_long
from elastocal.study.evaluation import metrics


def draw_deviations(job: Job) -> None:
    settings = job.params
    frame, printed = read_long(job.input.metrics, metrics), pd.read_csv(job.input.reference, dtype={"table": str})
    save(
        deviations(frame, printed, settings.title, settings.robot, settings.order, settings.limit),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_deviations, snakemake)
