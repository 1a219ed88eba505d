"""Refuse a run of which some check of its audit does not hold."""

from job import Job, run

import pandas as pd

from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_text


def judge_audit(job: Job) -> None:
    table = pd.read_csv(job.input.table, keep_default_na=False)
    for first in table[~table["holds"]].to_dict("records"):
        failed = f"{(~table['holds']).sum()} of {len(table)} checks do not hold, see {job.input.page}"
        found = f"{failed}; first {first['checked']}: {first['note']}"
        raise InputError(first["file"], "", found, "what the independent path finds")
    words = f"{table['file'].nunique()} files, {len(table)} checks, {table['compared'].sum()} values compared: all hold\n"
    write_text(job.output.verdict, words)


run(judge_audit, snakemake)
