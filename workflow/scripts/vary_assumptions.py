"""What known geometry and equal noise are worth, for one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.assumptions import geometry_rows, weighting_rows
from elastocal.study.steps.in_memory import study_in_memory
from elastocal.study.table_schemas import GEOMETRY, WEIGHTING


def vary_assumptions(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    study = study_in_memory(job.wildcards.robot, **settings.study)
    write_table(job.output.geometry, GEOMETRY, [geometry_rows(study, **settings.geometry)], origin)
    write_table(job.output.weighting, WEIGHTING, [weighting_rows(study, **settings.weighting)], origin)


run(vary_assumptions, snakemake)
