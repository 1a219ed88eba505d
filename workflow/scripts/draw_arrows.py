"""Residuals of a campaign as arrows where they were measured, before and after."""

from job import Job, origin_of, run

from elastocal.figures.residuals import arrows
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.loop.residual_tables import angles_of, read_residuals, worst_measurement
from elastocal.mechanics.kinematics import corners
from elastocal.mechanics.robot_file import robot_from_document


def draw_arrows(job: Job) -> None:
    robot = robot_from_document(read_json(job.input.descriptions)["robot"])
    table = read_residuals(job.input.residuals, robot.joints)
    arm = corners(robot.chain, angles_of(table, robot.joints)[worst_measurement(table)])
    save(arrows(table, arm), job.output.pdf, job.output.png, origin_of(job))


run(draw_arrows, snakemake)
