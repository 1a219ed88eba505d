"""How often intervals of parameters contain the true value."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal_proof.figures.blind_rates import coverage_by_effect


def draw_blind_coverage(job: Job) -> None:
    save(coverage_by_effect(pd.read_csv(job.input.coverage)), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_coverage, snakemake)
