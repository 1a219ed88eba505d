"""Random against optimal configurations of one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.designs import design_worths
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.table_schemas import DESIGNS


def choose_designs(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.designs, DESIGNS, [design_worths(study, settings.candidates, settings.sizes)], origin)


run(choose_designs, snakemake)
