"""What one data set gives, for every strategy, robot and noise level."""

from job import Job, run

from elastocal.io.data_frames import read_frame, read_long, write_csv
from elastocal.study.table_schemas import BOUNDS, accuracy
from elastocal.study.tables import add_slugs, per_dataset_table


def tabulate_accuracy(job: Job) -> None:
    settings = job.params
    bounds = {robot: read_frame(path, BOUNDS) for robot, path in zip(settings.robots, job.input.bounds, strict=True)}
    table = per_dataset_table(read_long(job.input.accuracy, accuracy), bounds, settings.points)
    write_csv(job.output.table, add_slugs(table, settings.slugs))


run(tabulate_accuracy, snakemake)
