"""Simulated errors of random and chosen configurations."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.study.question_tables import simulated_designs_table
from elastocal.study.table_schemas import SIMULATED_DESIGNS


def tabulate_simulated_designs(job: Job) -> None:
    frames = {
        robot: read_frame(path, SIMULATED_DESIGNS) for robot, path in zip(job.params.robots, job.input.designs, strict=True)
    }
    write_csv(job.output.table, simulated_designs_table(frames))


run(tabulate_simulated_designs, snakemake)
