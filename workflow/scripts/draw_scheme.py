"""Draw Figures 2 and 3: the kinematic scheme of a robot, and its springs."""

from job import Job, origin_of, run

from elastocal.figures import schemes
from elastocal.figures.style import save
from elastocal.mechanics.robot_file import parse_robot


def draw_scheme(job: Job) -> None:
    robot = parse_robot(job.params.robot)
    save(
        getattr(schemes, job.params.scheme)(robot),
        job.output.pdf,
        job.output.png,
        origin_of(job),
    )


run(draw_scheme, snakemake)
