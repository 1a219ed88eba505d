"""Typeset the report of the study as PDF."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.io.json_files import read_json
from elastocal.report.study import format_paper_tables
from elastocal.report.typesetting import compile_document

TABLES = ("table1", "table2", "table3", "table4")


def compile_report(job: Job) -> None:
    facts = read_json(job.input.answers)
    frames = {name: pd.read_csv(job.input[name]) for name in TABLES}
    tables = format_paper_tables(
        frames, facts["names"], int(facts["size"]["configurations"])
    )
    attachments = [*job.input.figures, job.input.bibliography]
    compile_document(
        job.output.report,
        "study.typ",
        {"facts": facts, "tables": tables},
        attachments,
        origin_of(job),
    )


run(compile_report, snakemake)
