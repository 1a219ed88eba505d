"""Tables of the study as a page of the documentation."""

import json
from pathlib import Path

from job import Job, run

from elastocal.io.atomic_writes import write_text
from elastocal.report.study_page import study_page


def write_study_page(job: Job) -> None:
    write_text(job.output.page, study_page(json.loads(Path(job.input.answers).read_text(encoding="utf-8"))))


run(write_study_page, snakemake)
