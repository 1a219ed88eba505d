"""Draw a ball in printed sockets, and where the model puts it before and after."""

from job import Job, origin_of, run

from elastocal.figures.sockets import draw_sockets as draw
from elastocal.figures.style import save
from elastocal.io.json_files import read_json
from elastocal.loop.schemas import read_residuals
from elastocal.mechanics.robot_file import parse_robot
from elastocal.verdict import read_verdict


def draw_sockets(job: Job) -> None:
    robot = parse_robot(read_json(job.input.descriptions)["robot"])
    figure = draw(
        read_residuals(job.input.residuals, robot.joints),
        read_verdict(job.input.verdict).heldout,
    )
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_sockets, snakemake)
