"""Random against optimal configurations."""

import pandas as pd

from elastocal.figures.questions import designs
from elastocal.figures.style import save

from job import Job, run


def draw_designs(job: Job) -> None:
    save(designs(pd.read_csv(job.input.table), job.params.titles, job.params.accuracy_um), job.output.pdf, job.output.png)


run(draw_designs, snakemake)
