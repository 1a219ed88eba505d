"""Figure 4: noise impact on the classical strategy."""

from job import Job, origin_of, run

from elastocal.figures.study import noise_impact
from elastocal.figures.style import save
from elastocal.io.data_frames import read_long
from elastocal.study.evaluation import metrics


def draw_noise_impact(job: Job) -> None:
    figure = noise_impact(read_long(job.input.metrics, metrics), job.params.strategy, job.params.titles)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_noise_impact, snakemake)
