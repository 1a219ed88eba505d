"""Held-out errors of all campaigns of one kind, before and after."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.loop import campaign_errors
from elastocal.figures.style import save


def draw_campaign_errors(job: Job) -> None:
    save(
        campaign_errors(pd.read_csv(job.input.table)),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_campaign_errors, snakemake)
