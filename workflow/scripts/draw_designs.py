"""Random against optimal configurations."""

import pandas as pd

from elastocal.figures.questions import designs
from elastocal.figures.style import save

from job import Job, origin_of, run


def draw_designs(job: Job) -> None:
    settings = job.params
    figure = designs(pd.read_csv(job.input.table), settings.titles, settings.accuracy_um, settings.joint_range)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_designs, snakemake)
