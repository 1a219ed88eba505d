"""Errors of the closed loop: by case, together with intervals, and as a figure."""

from pathlib import Path

from job import Job, origin_of, run

from elastocal.campaigns.reading import read_robot
from elastocal.figures.style import save
from elastocal.io.data_frames import read_frame, write_csv
from elastocal_proof.blind import schemas
from elastocal_proof.blind.closed_loop_summary import case_errors, goals, summary
from elastocal_proof.figures.closed_loop import closed_loop


def summarize_closed_loop(job: Job) -> None:
    joints = [read_robot(Path(robot)).joints for robot in job.input.robots]
    tables = {
        robot: read_frame(path, schemas.closed_loop(count))
        for robot, path, count in zip(job.params.robots, job.input.moved, joints, strict=True)
    }
    errors = case_errors(tables)
    table = summary(errors, job.params.seed)
    write_csv(job.output.errors, errors)
    write_csv(job.output.summary, table)
    write_csv(job.output.goals, goals(errors))
    save(closed_loop(table), job.output.figure, job.output.picture, origin_of(job))


run(summarize_closed_loop, snakemake)
