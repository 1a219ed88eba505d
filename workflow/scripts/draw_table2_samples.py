"""Table 2 against the statistics of single data sets."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures.study import table2_samples
from elastocal.figures.style import save
from elastocal.io.data_frames import read_frame
from elastocal.study.simulation import INITIAL


def draw_table2_samples(job: Job) -> None:
    titles = job.params.titles
    initial = {robot: read_frame(path, INITIAL) for robot, path in zip(titles, job.input.initial, strict=True)}
    reference = pd.read_csv(job.input.reference, dtype={"table": str}, keep_default_na=False)
    save(table2_samples(initial, reference, titles), job.output.pdf, job.output.png, origin_of(job))


run(draw_table2_samples, snakemake)
