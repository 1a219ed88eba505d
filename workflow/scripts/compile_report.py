"""The report as PDF."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.io.json_files import read_json
from elastocal.report.typesetting import compile_document
from elastocal.study.tables import list_rows

TABLES = ("table1", "table2", "table3", "table4", "interpretations")


def compile_report(job: Job) -> None:
    facts = read_json(job.input.answers)
    tables = {name: list_rows(pd.read_csv(job.input[name])) for name in TABLES}
    tables["figures"] = job.params.figures
    beside = [*job.input.figures, job.input.bibliography]
    compile_document(job.output.report, "study.typ", {"facts": facts, "tables": tables}, beside, origin_of(job))


run(compile_report, snakemake)
