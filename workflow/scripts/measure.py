"""Deflections of one robot as measured at one noise level."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.study.steps.measure import measured_blocks
from elastocal.study.table_schemas import DEFLECTIONS


def measure(job: Job) -> None:
    noise = 1e-6 * float(job.wildcards.noise)
    ideal = read_blocks(job.input.ideal, DEFLECTIONS)
    blocks = measured_blocks(ideal, job.wildcards.robot, job.params.seed, noise)
    write_table(job.output.measured, DEFLECTIONS, blocks, provenance(job.params, noise_um=job.wildcards.noise))


run(measure, snakemake)
