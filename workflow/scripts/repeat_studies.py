"""Scores of further studies of one robot, at the noise of the tables."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.repeat import repeated_blocks
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import repeated


def repeat_studies(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    strategies = [strategy_from_document(document) for document in settings.strategies]
    blocks = repeated_blocks(study, range(1, settings.studies + 1), strategies)
    write_table(job.output.repeated, repeated(study.robot.joints), blocks, origin)


run(repeat_studies, snakemake)
