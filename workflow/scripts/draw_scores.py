"""The paper's Table 4 among studies of the same size."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import scores
from elastocal.figures.style import save


def draw_scores(job: Job) -> None:
    comparison = pd.read_csv(job.input.comparison, dtype={"table": str})
    save(
        scores(comparison, pd.read_csv(job.input.expectations), job.params.titles),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_scores, snakemake)
