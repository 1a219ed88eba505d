"""Observability indices beside what they are worth."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import observability_table
from elastocal.study.table_schemas import OBSERVABILITY


def tabulate_observability(job: Job) -> None:
    robots = zip(job.params.robots, job.input.observabilities, strict=True)
    write_csv(job.output.table, observability_table({robot: read_frame(path, OBSERVABILITY) for robot, path in robots}))


run(tabulate_observability, snakemake)
