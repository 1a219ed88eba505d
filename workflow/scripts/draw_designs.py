"""Random against optimal configurations."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import designs
from elastocal.figures.style import save


def draw_designs(job: Job) -> None:
    settings = job.params
    figure = designs(pd.read_csv(job.input.table), settings.titles, settings.accuracy_um, settings.joint_range)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_designs, snakemake)
