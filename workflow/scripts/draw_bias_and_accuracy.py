"""Bias of the averaged model against the accuracy of one data set."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import bias_and_accuracy
from elastocal.figures.style import save
from elastocal.io.data_frames import read_long
from elastocal.study.evaluation import metrics


def draw_bias_and_accuracy(job: Job) -> None:
    settings = job.params
    per_dataset = pd.read_csv(job.input.per_dataset).query("noise_um == @settings.noise_um")
    figure = bias_and_accuracy(
        read_long(job.input.metrics, metrics), per_dataset, settings.titles, settings.order, settings.accuracy_um
    )
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_bias_and_accuracy, snakemake)
