"""A figure of the study: the function of `figures.study` that the rule names, of tables
and settings by their names."""

from functools import partial

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures import study
from elastocal.figures.style import save
from elastocal.io.data_frames import read_robot_tables
from elastocal.study.evaluation import make_metrics_schema
from elastocal.study.jobs import read_printed_figures

# By the name of an input; others are tables for people.
READ = {
    "metrics": partial(read_robot_tables, schema=make_metrics_schema),
    "printed": read_printed_figures,
}


def draw_study(job: Job) -> None:
    tables = {
        name: READ.get(name, partial(pd.read_csv, dtype={"table": str}))(
            job.input[name]
        )
        for name in job.params.tables
    }
    figure = getattr(study, job.params.figure)(**tables, **job.params.settings)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_study, snakemake)
