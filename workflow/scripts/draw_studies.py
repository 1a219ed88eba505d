"""Scores of all strategies over further studies."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import over_studies
from elastocal.figures.style import save
from elastocal.io.data_frames import read_studies
from elastocal.study.repeated import repeated


def draw_studies(job: Job) -> None:
    studies, printed = read_studies(job.input.studies, repeated), pd.read_csv(job.input.reference, dtype={"table": str})
    figure = over_studies(studies, printed, job.params.titles, job.params.order)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_studies, snakemake)
