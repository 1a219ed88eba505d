"""Draw how each effect of the catalogue displaces a measured point."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.reading import read_robot
from elastocal.effects.catalogue import list_bundled_effects
from elastocal.figures.effect_signatures import compute_signature, draw_signature
from elastocal.figures.style import save_svg


def draw_signatures(job: Job) -> None:
    robot = read_robot(Path(job.input.robot))
    Path(job.output.figures).mkdir(exist_ok=True)
    for name in list_bundled_effects():
        save_svg(
            draw_signature(compute_signature(name, robot)),
            f"{job.output.figures}/{name}.svg",
        )


run(draw_signatures, snakemake)
