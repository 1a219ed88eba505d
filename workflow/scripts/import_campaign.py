"""Measured data of other people as a campaign's folder."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.importers import fetch, importer
from elastocal.campaigns.reading import folds_of


def import_campaign(job: Job) -> None:
    settings, name = job.params.source, job.wildcards.campaign
    source = importer(settings["importer"], Path(job.input.sources).parent, f"campaign {name}")
    paths = [fetch(file, source.files, job.params.kept, job.params.box) for file in settings["files"]]
    folder, robots = Path(job.output.document).parent, Path(job.input.robots[0]).parent
    source.write_campaign(paths, folder, robots, name, settings.get("holdout"))
    if "fold" in settings:
        source.write_campaign(paths, folder, robots, name, folds_of(folder, robots, **settings["fold"]))


run(import_campaign, snakemake)
