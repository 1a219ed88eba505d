"""Rates of verdicts that bad rows leave as they are, and of rows that are named."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal_proof.blind import schemas
from elastocal_proof.blind.bad_rows_summary import judge_cases, summarize


def summarize_bad_rows(job: Job) -> None:
    tables = {robot: read_frame(path, schemas.BAD_ROWS) for robot, path in zip(job.params.robots, job.input.slips, strict=True)}
    slips = judge_cases(tables)
    write_csv(job.output.cases, slips)
    write_csv(job.output.summary, summarize(slips))


run(summarize_bad_rows, snakemake)
