"""Deflection of one robot before calibration, data set by data set."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.study.steps.initial import initial_blocks
from elastocal.study.table_schemas import DEFLECTIONS, INITIAL


def summarize_initial(job: Job) -> None:
    ideal = read_blocks(job.input.ideal, DEFLECTIONS, point=job.params.end_effector)
    write_table(job.output.initial, INITIAL, initial_blocks(ideal), provenance(job.params))


run(summarize_initial, snakemake)
