"""Observability indices of one robot's data sets, beside what they are worth."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.observability import observability_columns
from elastocal.study.table_schemas import OBSERVABILITY


def index_observability(job: Job) -> None:
    study = study_in_memory(job.wildcards.robot, **job.params.study)
    origin = provenance(job.params, **dict(job.wildcards))
    write_table(job.output.observability, OBSERVABILITY, [observability_columns(study)], origin)


run(index_observability, snakemake)
