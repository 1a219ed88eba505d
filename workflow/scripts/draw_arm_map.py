"""What a second target is worth at every place of the arm."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.arms import arm_map
from elastocal.figures.style import save
from elastocal.mechanics.kinematics import corners
from elastocal.mechanics.robot_file import robot_from_document


def draw_arm_map(job: Job) -> None:
    robots = {name: robot_from_document(document) for name, document in job.params.robots.items()}
    outlines = {name: corners(robot.chain, robot.joint_limits.mean(axis=1)) for name, robot in robots.items()}
    save(arm_map(pd.read_csv(job.input.table), outlines, job.params.titles), job.output.pdf, job.output.png, origin_of(job))


run(draw_arm_map, snakemake)
