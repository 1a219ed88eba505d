"""All cases of the closed loop on one robot, as one table."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.reading import read_robot
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal_proof.blind import schemas
from elastocal_proof.blind.closed_loop import cases, closed_loop


def close_loop(job: Job) -> None:
    robot = Path(job.input.robot)
    blocks = (
        closed_loop(str(robot), str(robot.parent), *case, slips=job.params.slips)
        for case in cases(str(robot), job.params.seed, job.params.each)
    )
    write_table(
        job.output.moved, schemas.closed_loop(read_robot(robot).joints), blocks, provenance(job.params, **job.wildcards)
    )


run(close_loop, snakemake)
