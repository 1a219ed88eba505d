"""What a second target is worth at every place of the arm."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import places_table
from elastocal.study.table_schemas import PLACES


def tabulate_places(job: Job) -> None:
    frames = {robot: read_frame(path, PLACES) for robot, path in zip(job.params.robots, job.input.places, strict=True)}
    write_csv(job.output.table, places_table(frames))


run(tabulate_places, snakemake)
