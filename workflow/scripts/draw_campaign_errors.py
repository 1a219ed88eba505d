"""Draw the held-out errors of all campaigns of one kind, before and after."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.loop import draw_errors_by_campaign
from elastocal.figures.style import save


def draw_campaign_errors(job: Job) -> None:
    save(
        draw_errors_by_campaign(pd.read_csv(job.input.table)),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_campaign_errors, snakemake)
