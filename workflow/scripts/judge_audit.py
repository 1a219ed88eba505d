"""Fail if a check of the audit fails."""

from job import Job, run

import pandas as pd

from elastocal.errors import InputError
from elastocal.io.atomic_writes import write_text


def judge_audit(job: Job) -> None:
    table = pd.read_csv(job.input.table, keep_default_na=False)
    failed = table[~table["holds"]]
    if len(failed):
        first = failed.iloc[0]
        raise InputError(
            first["file"],
            "",
            f"{len(failed)} of {len(table)} checks do not hold, see {job.input.page};"
            f" first {first['checked']}: {first['note']}",
            "what the independent path finds",
        )
    write_text(
        job.output.verdict,
        f"{table['file'].nunique()} files, {len(table)} checks,"
        f" {table['compared'].sum()} values compared: all hold\n",
    )


run(judge_audit, snakemake)
