"""Accuracy of one data set, strategy by strategy."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import accuracy_of_one_data_set
from elastocal.figures.style import save


def draw_accuracy(job: Job) -> None:
    settings = job.params
    per_dataset = pd.read_csv(job.input.per_dataset).query("noise_um == @settings.noise_um")
    figure = accuracy_of_one_data_set(per_dataset, settings.titles, settings.order, settings.length)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_accuracy, snakemake)
