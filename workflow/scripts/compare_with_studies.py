"""Each figure that the paper prints among those of further studies of the same size."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_frame, read_studies, write_csv
from elastocal.study.printed import comparison_table
from elastocal.study.table_schemas import INITIAL, repeated


def compare_with_studies(job: Job) -> None:
    beside = pd.read_csv(job.input.beside, dtype={"table": str})
    initial = {robot: read_frame(path, INITIAL) for robot, path in zip(job.params.robots, job.input.initial, strict=True)}
    write_csv(job.output.table, comparison_table(beside, read_studies(job.input.studies, repeated), initial, job.params.length))


run(compare_with_studies, snakemake)
