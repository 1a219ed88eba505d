"""What known geometry and equal noise are worth."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import geometry_table, weighting_table
from elastocal.study.table_schemas import GEOMETRY, WEIGHTING


def tabulate_assumptions(job: Job) -> None:
    robots = job.params.robots
    geometry = {robot: read_frame(path, GEOMETRY) for robot, path in zip(robots, job.input.geometries, strict=True)}
    weighting = {robot: read_frame(path, WEIGHTING) for robot, path in zip(robots, job.input.weightings, strict=True)}
    write_csv(job.output.geometry, geometry_table(geometry))
    write_csv(job.output.weighting, weighting_table(weighting))


run(tabulate_assumptions, snakemake)
