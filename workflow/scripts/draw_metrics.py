"""Strategies by every metric."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import metrics
from elastocal.figures.style import save
from elastocal.report.study import METRIC_NAMES


def draw_metrics(job: Job) -> None:
    save(metrics(pd.read_csv(job.input.table), job.params.titles, METRIC_NAMES), job.output.pdf, job.output.png, origin_of(job))


run(draw_metrics, snakemake)
