"""Copy a campaign that comes with the project, under the name of its file in config."""

from pathlib import Path

from job import Job, run

from elastocal.campaigns.included import copy_included_campaign as copy


def copy_included_campaign(job: Job) -> None:
    settings = job.params.source
    copy(
        job.params.folder,
        Path(job.output.document).parent,
        job.wildcards.campaign,
        settings["sha256"],
        settings.get("holdout"),
    )


run(copy_included_campaign, snakemake)
