"""What is found at which size, beside the oracle."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal_proof.figures.blind_power import power_map


def draw_blind_power(job: Job) -> None:
    save(power_map(pd.read_csv(job.input.power)), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_power, snakemake)
