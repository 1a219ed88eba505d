"""Residuals of a campaign against what the robot did, before and after."""

from job import Job, origin_of, run

from elastocal.figures.residuals import residuals
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.loop.residual_tables import read_residuals
from elastocal.mechanics.robot_file import joint_count


def draw_residuals(job: Job) -> None:
    joints = joint_count(read_json(job.input.descriptions)["robot"])
    save(residuals(read_residuals(job.input.residuals, joints)), job.output.pdf, job.output.png, origin_of(job))


run(draw_residuals, snakemake)
