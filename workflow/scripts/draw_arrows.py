"""Residuals of a campaign as arrows where they were measured, before and after."""

import json

from elastocal.figures.residuals import arrows
from elastocal.figures.style import save
from elastocal.loop.schemas import residuals as schema
from elastocal.storage import read_table

from job import run


def draw_arrows(job):
    with open(job.input.descriptions, encoding="utf-8") as file:
        joints = len(json.load(file)["robot"]["compliance_urad_per_Nm"])
    save(arrows(read_table(job.input.residuals, schema(joints))), job.output.pdf, job.output.png)


run(draw_arrows, snakemake)
