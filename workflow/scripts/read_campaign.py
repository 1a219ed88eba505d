"""A campaign's folder, checked, as tables: readings to fit and readings to test."""

from elastocal.campaigns.columns import reading_columns
from elastocal.io.json_files import write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.loop.loading import taken_in
from elastocal.loop.schemas import readings

from job import run


def read_campaign(job):
    descriptions, training, held_out = taken_in(job.params.folder, job.params.robots)
    for path, part in ((job.output.training, training), (job.output.held_out, held_out)):
        schema = readings(part.joint_angles.shape[1])
        write_table(path, schema, [reading_columns(part)], provenance(descriptions, **job.wildcards))
    write_json(job.output.descriptions, descriptions)


run(read_campaign, snakemake)
