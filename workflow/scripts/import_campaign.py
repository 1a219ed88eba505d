"""Make the folder of a campaign from public measured data."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.importers import fetch, find_importer


def import_campaign(job: Job) -> None:
    settings = job.params.source
    name = job.wildcards.campaign
    source = find_importer(
        settings["importer"], Path(job.input.sources).parent, f"campaign {name}"
    )
    paths = [
        fetch(file, source.files, job.params.kept, job.params.box)
        for file in settings["files"]
    ]
    folder = Path(job.output.document).parent
    robots = Path(job.input.robots[0]).parent
    test = {key: settings[key] for key in ("holdout", "fold") if key in settings}
    source.write_campaign(paths, folder, robots, name, **test)


run(import_campaign, snakemake)
