"""Refuse a run of which some check of its audit does not hold."""

from job import Job, run

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal_proof.audit.whole import require_all


def judge_audit(job: Job) -> None:
    write_text(job.output.verdict, require_all(pd.read_csv(job.input.table, keep_default_na=False), job.input.page))


run(judge_audit, snakemake)
