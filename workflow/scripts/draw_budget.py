"""Sets of measuring points at an equal budget."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import budget
from elastocal.figures.style import save


def draw_budget(job: Job) -> None:
    save(
        budget(pd.read_csv(job.input.table), job.params.titles, job.params.length),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_budget, snakemake)
