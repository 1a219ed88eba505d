"""Draw the arm of a campaign with its errors at held-out poses, before and after."""

from job import Job, origin_of, run

from elastocal.figures.arms import draw_arm_with_errors
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.loop.schemas import read_residuals
from elastocal.mechanics.robot_file import parse_robot
from elastocal.verdict import read_verdict


def draw_hero(job: Job) -> None:
    robot = parse_robot(read_json(job.input.descriptions)["robot"])
    figure = draw_arm_with_errors(
        robot,
        read_residuals(job.input.residuals, robot.joints),
        read_verdict(job.input.verdict).heldout,
    )
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_hero, snakemake)
