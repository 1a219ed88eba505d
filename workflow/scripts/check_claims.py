"""Equation 6 and the starts of an iterative solver, for one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.claim_checks import start_columns, stiffness_columns
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import STARTS, STIFFNESS


def check_claims(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    starts = start_columns(study, strategy_from_document(settings.strategy), settings.starts)
    write_table(job.output.stiffness, STIFFNESS, [stiffness_columns(study, settings.forces_N)], origin)
    write_table(job.output.starts, STARTS, [starts], origin)


run(check_claims, snakemake)
