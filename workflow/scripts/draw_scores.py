"""Distance of each printed figure from ours."""

import pandas as pd

from elastocal.figures.against_paper import scores
from elastocal.figures.style import save

from job import Job, run


def draw_scores(job: Job) -> None:
    save(scores(pd.read_csv(job.input.comparison, dtype={"table": str})), job.output.pdf, job.output.png)


run(draw_scores, snakemake)
