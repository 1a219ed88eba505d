"""Residuals of a campaign against what the robot did, before and after."""

import json

from elastocal.figures.residuals import residuals
from elastocal.figures.style import save
from elastocal.loop.schemas import residuals as schema
from elastocal.storage import read_table

from job import run


def draw_residuals(job):
    with open(job.input.descriptions, encoding="utf-8") as file:
        joints = len(json.load(file)["robot"]["compliance_urad_per_Nm"])
    save(residuals(read_table(job.input.residuals, schema(joints))), job.output.pdf, job.output.png)


run(draw_residuals, snakemake)
