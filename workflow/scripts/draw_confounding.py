"""Angles between the contributions of the leading candidates."""

from job import Job, origin_of, run

from elastocal.figures.candidates import confounding
from elastocal.figures.style import save
from elastocal.io.storage import read_table
from elastocal.loop.schemas import CANDIDATES, CONFOUNDING


def draw_confounding(job: Job) -> None:
    figure = confounding(read_table(job.input.candidates, CANDIDATES), read_table(job.input.confounding, CONFOUNDING))
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_confounding, snakemake)
