"""Bootstrap weights of one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.study.steps.weights import weight_blocks
from elastocal.study.table_schemas import WEIGHTS


def draw_weights(job: Job) -> None:
    settings = job.params
    drawn = weight_blocks(job.wildcards.robot, settings.seed, settings.data_sets, settings.tests, settings.replicates)
    write_table(job.output.weights, WEIGHTS, drawn, provenance(settings, **dict(job.wildcards)))


run(draw_weights, snakemake)
