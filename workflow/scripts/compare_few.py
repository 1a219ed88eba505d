"""Errors of one robot from few configurations, with and without a prior."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.few_configurations import few_blocks
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import FEW


def compare_few(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    strategies = [strategy_from_document(document) for document in settings.strategies]
    write_table(job.output.few, FEW, few_blocks(study, strategies, settings.nominal_errors), origin)


run(compare_few, snakemake)
