"""How much the diameter of the extended robot's tubes matters."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import tubes_table
from elastocal.study.table_schemas import TUBES


def tabulate_tubes(job: Job) -> None:
    frames = {robot: read_frame(path, TUBES) for robot, path in zip(job.params.robots, job.input.tubes, strict=True)}
    write_csv(job.output.table, tubes_table(frames))


run(tabulate_tubes, snakemake)
