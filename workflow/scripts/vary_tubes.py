"""One robot with elastic links, its tubes of other diameters."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.tubes import tube_blocks
from elastocal.study.table_schemas import TUBES


def vary_tubes(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.tubes, TUBES, tube_blocks(study, settings.factors, settings.length), origin)


run(vary_tubes, snakemake)
