"""Figures of the blind proof against their targets, as a picture and as a table."""

from pathlib import Path

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal.io.atomic_writes import write_text
from elastocal.io.documents import read_document
from elastocal_proof.blind.targets import of_each_robot
from elastocal_proof.figures.blind_rates import rates_and_targets
from elastocal_proof.report.blind_pages import targets_page


def draw_blind_targets(job: Job) -> None:
    settings = job.params
    summary, cases, stated = (pd.read_csv(job.input[name]) for name in ("summary", "cases", "probabilities"))
    names = {Path(file).stem: read_document(file)["name"] for file in job.input.robots}
    alone = {names[robot]: table for robot, table in of_each_robot(cases, stated, settings.seed).items()}
    write_text(job.output.page, targets_page(summary, alone, settings.size, settings.seed))
    save(rates_and_targets(summary), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_targets, snakemake)
