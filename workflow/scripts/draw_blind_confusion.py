"""Confusion matrix: verdicts by ground truth."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.style import save
from elastocal_proof.figures.blind_power import confusion_map


def draw_blind_confusion(job: Job) -> None:
    save(confusion_map(pd.read_csv(job.input.confusion)), job.output.pdf, job.output.png, origin_of(job))


run(draw_blind_confusion, snakemake)
