"""What stated probabilities are worth."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal_proof.figures.blind_reliability import reliability_diagram


def draw_blind_reliability(job: Job) -> None:
    save(reliability_diagram(pd.read_csv(job.input.reliability)), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_reliability, snakemake)
