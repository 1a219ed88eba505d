"""Simulated errors of random and chosen configurations of one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.simulated_designs import simulated_design_blocks
from elastocal.study.table_schemas import SIMULATED_DESIGNS


def simulate_designs(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    blocks = simulated_design_blocks(study, settings.candidates, settings.sizes, settings.loads, settings.uses)
    write_table(job.output.designs, SIMULATED_DESIGNS, blocks, origin)


run(simulate_designs, snakemake)
