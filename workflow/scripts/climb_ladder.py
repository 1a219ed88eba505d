"""Models of one robot with more and more link springs."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.steps.ladder import ladder_blocks
from elastocal.study.table_schemas import LADDER


def climb_ladder(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.ladder, LADDER, ladder_blocks(study, settings.lengths, settings.noises), origin)


run(climb_ladder, snakemake)
