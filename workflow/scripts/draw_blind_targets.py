"""Figures of the blind proof against their targets."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal_proof.figures.blind_rates import rates_and_targets


def draw_blind_targets(job: Job) -> None:
    save(rates_and_targets(pd.read_csv(job.input.summary)), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_targets, snakemake)
