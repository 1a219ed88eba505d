"""Random against optimal configurations."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import designs_table
from elastocal.study.table_schemas import DESIGNS


def tabulate_designs(job: Job) -> None:
    robots = zip(job.params.robots, job.input.designs, strict=True)
    write_csv(job.output.table, designs_table({robot: read_frame(path, DESIGNS) for robot, path in robots}))


run(tabulate_designs, snakemake)
