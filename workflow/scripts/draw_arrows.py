"""Residuals of a campaign as arrows where they were measured, before and after."""

from elastocal.figures.residuals import arrows
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.schemas import residuals as schema

from job import Job, run


def draw_arrows(job: Job) -> None:
    joints = len(read_json(job.input.descriptions)["robot"]["compliance_urad_per_Nm"])
    save(arrows(read_table(job.input.residuals, schema(joints))), job.output.pdf, job.output.png)


run(draw_arrows, snakemake)
