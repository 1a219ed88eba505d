"""Draw a figure of the study by the function of `figures.study` that its rule names.

The rule also names the tables and the settings that this function takes.
"""

from functools import partial

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures import study
from elastocal.figures.style import save
from elastocal.io.data_frames import read_robot_tables
from elastocal.study.jobs import read_printed_figures
from elastocal.study.schemas import METRICS

# Readers of inputs by their names; all other inputs are CSV tables.
READERS = {
    "metrics": partial(read_robot_tables, schema=METRICS),
    "printed": read_printed_figures,
}


def read_csv(path: str) -> pd.DataFrame:
    # Numbers of tables are names.
    return pd.read_csv(path, dtype={"table": str})


def draw_study(job: Job) -> None:
    tables = {}
    for name in job.params.tables:
        read = READERS.get(name, read_csv)
        tables[name] = read(job.input[name])
    figure = getattr(study, job.params.figure)(**tables, **job.params.settings)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_study, snakemake)
