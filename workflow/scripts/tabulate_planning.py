"""Gains by planning of all robots."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json


def tabulate_planning(job: Job) -> None:
    rows = [{"robot": robot} | read_json(path) for robot, path in zip(job.params.robots, job.input.gains, strict=True)]
    write_csv(job.output.table, pd.DataFrame(rows))


run(tabulate_planning, snakemake)
