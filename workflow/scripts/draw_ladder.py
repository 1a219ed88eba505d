"""Error of one data set by number of link springs."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import ladder
from elastocal.figures.style import save


def draw_ladder(job: Job) -> None:
    save(ladder(pd.read_csv(job.input.table)), job.output.pdf, job.output.png, origin_of(job))


run(draw_ladder, snakemake)
