"""Draw the figures of a campaign: residuals, candidate effects and errors."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.loop import (
    draw_before_after,
    draw_probabilities,
    draw_residual_arrows,
)
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.loop.schemas import find_worst_joint_angles, read_residuals
from elastocal.mechanics.kinematics import locate_corners
from elastocal.mechanics.robot_file import parse_robot
from elastocal.verdict import read_verdict


def draw_campaign(job: Job) -> None:
    robot = parse_robot(read_json(job.input.descriptions)["robot"])
    table = read_residuals(job.input.residuals, robot.joints)
    arm = locate_corners(robot.chain, find_worst_joint_angles(table, robot.joints))
    candidates = pd.read_csv(job.input.candidates).fillna({"note": ""})
    verdict = read_verdict(job.input.verdict)
    errors = pd.read_csv(job.input.before_after).to_dict("records")
    figures = {
        "before_after": draw_before_after(errors, verdict.heldout.noise_floor_rms_m),
        "arrows": draw_residual_arrows(table, arm),
        "candidates": draw_probabilities(
            verdict.probabilities,
            {name: column.to_numpy() for name, column in candidates.items()},
        ),
    }
    for name, pdf, png in zip(
        job.params.figures, job.output.pdf, job.output.png, strict=True
    ):
        save(figures[name], pdf, png, origin_of(job))


run(draw_campaign, snakemake)
