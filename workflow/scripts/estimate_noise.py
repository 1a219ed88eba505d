"""Noise of the readings, from repeats where there are enough."""

import json

from elastocal.frames import write_text
from elastocal.loop.declared import noise_of
from elastocal.loop.opened import opened_case

from job import run


def estimate_noise(job):
    case = opened_case(job.input.descriptions, job.input.training)
    write_text(job.output.noise, json.dumps(noise_of(case), indent=1) + "\n")


run(estimate_noise, snakemake)
