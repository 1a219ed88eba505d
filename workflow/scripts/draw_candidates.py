"""Candidates of a search in the order in which they stand out."""

from elastocal.figures.candidates import scree
from elastocal.figures.style import save
from elastocal.loop.schemas import CANDIDATES
from elastocal.storage import read_table

from job import run


def draw_candidates(job):
    save(scree(read_table(job.input.candidates, CANDIDATES)), job.output.pdf, job.output.png)


run(draw_candidates, snakemake)
