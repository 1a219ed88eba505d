"""All cases of bad rows on one robot, as one table."""

from pathlib import Path

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal_proof.blind import schemas
from elastocal_proof.blind.bad_rows import compare_verdicts, draw_seeds


def compare(job: Job) -> None:
    robot = Path(job.input.robot)
    seeds = draw_seeds(robot, job.params.seed, job.params.each)
    blocks = (compare_verdicts(robot, robot.parent, seed) for seed in seeds)
    write_table(job.output.slips, schemas.BAD_ROWS, blocks, provenance(job.params, **job.wildcards))


run(compare, snakemake)
