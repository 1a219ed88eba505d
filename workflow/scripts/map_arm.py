"""What a second target is worth at every place of one robot's arm."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.arm_points import place_columns
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.table_schemas import PLACES


def map_arm(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.places, PLACES, [place_columns(study, settings.tracker_m, settings.arm_points)], origin)


run(map_arm, snakemake)
