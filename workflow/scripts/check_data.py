"""Faults of the data, before any physics."""

from dataclasses import asdict

from elastocal.hygiene import faults
from elastocal.json_files import write_json
from elastocal.loop.opened import opened_case

from job import run


def check_data(job):
    case = opened_case(job.input.descriptions, job.input.training)
    found = [asdict(fault) for fault in faults(case.campaign, case.campaign.readings)]
    write_json(job.output.faults, found, default=float)


run(check_data, snakemake)
