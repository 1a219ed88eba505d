"""Cost of an accuracy by each set of points."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import costs
from elastocal.figures.style import save


def draw_costs(job: Job) -> None:
    table, break_even = pd.read_csv(job.input.table), pd.read_csv(job.input.break_even)
    figure = costs(table, break_even, job.params.titles, job.params.accuracy_um)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_costs, snakemake)
