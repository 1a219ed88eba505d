"""Errors on held-out poses, model by model."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.before_after import before_after
from elastocal.figures.style import save
from elastocal.io.json_files import read_json


def draw_before_after(job: Job) -> None:
    floor = read_json(job.input.verdict)["heldout"]["noise_floor_rms_m"]
    figure = before_after(pd.read_csv(job.input.before_after).to_dict("records"), floor)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_before_after, snakemake)
