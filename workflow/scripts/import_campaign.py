"""Measured data of other people as a campaign's folder."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.importers.catalogue import importer
from elastocal.campaigns.public_data import fetch
from elastocal.campaigns.reading import folds_of


def import_campaign(job: Job) -> None:
    settings, name = job.params.source, job.wildcards.campaign
    source = importer(settings["importer"], f"campaign {name}")
    paths = [fetch(file, source.FILES, job.params.kept, job.params.box) for file in settings["files"]]
    folder, described = Path(job.output.document).parent, Path(job.input.robots[0]).parent
    robots = (described,) if settings["importer"] == "fanuc_joint" else ()
    source.write_campaign(*paths, folder, *robots, name=name, holdout=settings.get("holdout"))
    if "fold" in settings:
        source.write_campaign(*paths, folder, *robots, name=name, holdout=folds_of(folder, described, **settings["fold"]))


run(import_campaign, snakemake)
