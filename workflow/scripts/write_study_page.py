"""Write the tables of the study as a page of the documentation."""

from job import Job, run

from elastocal.io.atomic_writes import write_text
from elastocal.io.json_files import read_json
from elastocal.report.typesetting import load_template


def write_study_page(job: Job) -> None:
    write_text(
        job.output.page,
        load_template("study_tables.md").render(read_json(job.input.answers)),
    )


run(write_study_page, snakemake)
