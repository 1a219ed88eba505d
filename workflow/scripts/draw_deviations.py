"""Figures 5c and 5d: deviation of all strategies."""

from elastocal.figures.strategies import deviations
from elastocal.figures.style import save
from elastocal.io.data_frames import read_long
from elastocal.study.table_schemas import metrics

from job import Job, run


def draw_deviations(job: Job) -> None:
    settings = job.params
    frame = read_long(job.input.metrics, metrics)
    save(deviations(frame, settings.title, settings.robot, settings.order, settings.limit), job.output.pdf, job.output.png)


run(draw_deviations, snakemake)
