"""Expectations beside further studies and the paper."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_long, read_studies, write_csv
from elastocal.study.study_tables import expectations_table
from elastocal.study.table_schemas import expected, repeated


def tabulate_expectations(job: Job) -> None:
    settings = job.params
    reference = pd.read_csv(job.input.reference, dtype={"table": str}, keep_default_na=False)
    studies, expectations = read_studies(job.input.studies, repeated), read_long(job.input.expected, expected)
    write_csv(job.output.table, expectations_table(studies, expectations, reference, settings.length, settings.strategies))


run(tabulate_expectations, snakemake)
