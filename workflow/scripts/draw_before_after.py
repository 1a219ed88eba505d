"""Errors on held-out poses, model by model."""

import json

import pandas as pd

from elastocal.figures.before_after import before_after
from elastocal.figures.style import save

from job import run


def draw_before_after(job):
    with open(job.input.errors, encoding="utf-8") as file:
        floor = json.load(file)["heldout"]["noise_floor_rms_m"]
    figure = before_after(pd.read_csv(job.input.before_after).to_dict("records"), floor)
    save(figure, job.output.pdf, job.output.png)


run(draw_before_after, snakemake)
