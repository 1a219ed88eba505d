"""Angles between the contributions of the leading candidates."""

from elastocal.diagnosis.tables import CANDIDATES, CONFOUNDING
from elastocal.figures.candidates import confounding
from elastocal.figures.style import save
from elastocal.storage import read_table

from job import run


def draw_confounding(job):
    figure = confounding(read_table(job.input.candidates, CANDIDATES), read_table(job.input.confounding, CONFOUNDING))
    save(figure, job.output.pdf, job.output.png)


run(draw_confounding, snakemake)
