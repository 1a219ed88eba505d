"""Faults of the data, before any physics."""

import json
from dataclasses import asdict

from elastocal.frames import write_text
from elastocal.hygiene import faults
from elastocal.loop.opened import opened_case

from job import run


def check_data(job):
    case = opened_case(job.input.descriptions, job.input.training)
    found = [asdict(fault) for fault in faults(case.campaign, case.campaign.readings)]
    write_text(job.output.faults, json.dumps(found, indent=1, default=float) + "\n")


run(check_data, snakemake)
