"""Errors that one robot's strategies leave, by several yardsticks."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.uses import use_blocks
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import USES


def judge_in_use(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    strategies = [strategy_from_document(document) for document in settings.strategies]
    write_table(job.output.uses, USES, use_blocks(study, strategies, settings.uses), origin)


run(judge_in_use, snakemake)
