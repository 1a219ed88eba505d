"""Errors of one robot by what is measured."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.measurement_kinds import kind_blocks
from elastocal.study.table_schemas import KINDS


def compare_kinds(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.kinds, KINDS, kind_blocks(study, settings.reflectors, settings.encoders_rad), origin)


run(compare_kinds, snakemake)
