"""Errors and bounds of one robot for every set of measuring points."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.budget import budget_blocks
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.table_schemas import BUDGET


def compare_point_sets(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.budget, BUDGET, budget_blocks(study, settings.point_sets), origin)


run(compare_point_sets, snakemake)
