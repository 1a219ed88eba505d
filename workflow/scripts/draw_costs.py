"""Cost of an accuracy by each set of points."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import costs
from elastocal.figures.style import save


def draw_costs(job: Job) -> None:
    figure = costs(pd.read_csv(job.input.table), job.params.titles, job.params.accuracy_um)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_costs, snakemake)
