"""A figure of the study: the function of `figures.study` that the rule names, of tables and settings by their names."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.figures import study
from elastocal.figures.style import save
from elastocal.io.data_frames import read_long, read_studies
from elastocal.study.evaluation import metrics
from elastocal.study.jobs import read_reference
from elastocal.study.repeated import repeated

# By the name of an input; others are tables for people.
READ = {
    "metrics": lambda files: read_long(files, metrics),
    "studies": lambda files: read_studies(files, repeated),
    "printed": read_reference,
    "reference": read_reference,
}


def read_table(path: str) -> pd.DataFrame:
    return pd.read_csv(path, dtype={"table": str})


def draw_study(job: Job) -> None:
    tables = {name: READ.get(name, read_table)(job.input[name]) for name in job.params.tables}
    if "per_dataset" in tables:
        tables["per_dataset"] = tables["per_dataset"].query("noise_um == @job.params.noise_um")
    figure = getattr(study, job.params.figure)(**tables, **job.params.settings)
    save(figure, job.output.pdf, job.output.png, origin_of(job))


run(draw_study, snakemake)
