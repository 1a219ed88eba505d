"""Noise of the readings, from repeats where there are enough."""

from elastocal.json_files import write_json
from elastocal.loop.declared import noise_of
from elastocal.loop.opened import opened_case

from job import run


def estimate_noise(job):
    case = opened_case(job.input.descriptions, job.input.training)
    write_json(job.output.noise, noise_of(case))


run(estimate_noise, snakemake)
