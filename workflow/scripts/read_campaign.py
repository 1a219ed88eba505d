"""A campaign's folder, checked, as tables: measurements to fit and measurements to test."""

from job import Job, run

from elastocal.campaigns.columns import columns_of
from elastocal.io.json_files import write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.loop.loading import load_campaign
from elastocal.loop.schemas import measurements


def read_campaign(job: Job) -> None:
    descriptions, training, held_out = load_campaign(job.params.folder, job.params.robots)
    for path, part in ((job.output.training, training), (job.output.held_out, held_out)):
        schema = measurements(part.joint_angles.shape[1])
        write_table(path, schema, [columns_of(part)], provenance(descriptions, **job.wildcards))
    write_json(job.output.descriptions, descriptions)


# Of a user's own files there is no record.
run(read_campaign, snakemake, snakemake.input.sources if snakemake.params.get("files_sha256") else None)
