"""All campaigns of one kind on one page."""

from job import Job, run

from elastocal.io.data_frames import read_frame, write_csv
from elastocal.io.json_files import read_json
from elastocal.loop.schemas import residuals
from elastocal.loop.summary import campaign_rows


def summarize_campaigns(job: Job) -> None:
    settings = job.params
    verdicts = {name: read_json(path) for name, path in zip(settings.campaigns, job.input.verdicts, strict=True)}
    held_out = {
        name: read_frame(path, residuals(len(verdicts[name]["noise"]["joint_rad"]))).query("held_out and not gross_error")
        for name, path in zip(settings.campaigns, job.input.residuals, strict=True)
    }
    write_csv(job.output.table, campaign_rows(verdicts, held_out, settings.folds, settings.seed))


run(summarize_campaigns, snakemake)
