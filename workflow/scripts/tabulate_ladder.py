"""Springs that pay."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import ladder_table
from elastocal.study.table_schemas import LADDER


def tabulate_ladder(job: Job) -> None:
    robots = zip(job.params.robots, job.input.ladders, strict=True)
    write_csv(job.output.table, ladder_table({robot: read_frame(path, LADDER) for robot, path in robots}))


run(tabulate_ladder, snakemake)
