"""Measured data of other people as a campaign's folder."""

from pathlib import Path

from elastocal.campaigns.importers import fanuc_cpa, fanuc_joint, fanuc_static, jacobi, motoman, ur10_ipa
from elastocal.campaigns.public_data import fetch
from elastocal.campaigns.reading import folds_of

from job import Job, run

IMPORTERS = {
    "fanuc_static": fanuc_static,
    "fanuc_cpa": fanuc_cpa,
    "fanuc_joint": fanuc_joint,
    "ur10_ipa": ur10_ipa,
    "jacobi": jacobi,
    "motoman": motoman,
}


def import_campaign(job: Job) -> None:
    settings = job.params.source
    paths = [fetch(name, job.params.kept) for name in settings["files"]]
    folder, name = Path(job.output.document).parent, job.wildcards.campaign
    described = Path(job.input.robots[0]).parent
    robots = (described,) if settings["importer"] == "fanuc_joint" else ()
    write = IMPORTERS[settings["importer"]].write_campaign
    write(*paths, folder, *robots, name=name, holdout=settings.get("holdout"))
    if "fold" in settings:
        write(*paths, folder, *robots, name=name, holdout=folds_of(folder, described, **settings["fold"]))


run(import_campaign, snakemake)
