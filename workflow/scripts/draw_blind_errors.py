"""Held-out errors of blind cases against the oracle's."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal_proof.figures.blind_errors import errors_against_oracle


def draw_blind_errors(job: Job) -> None:
    save(errors_against_oracle(pd.read_csv(job.input.cases)), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_errors, snakemake)
