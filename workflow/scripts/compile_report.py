"""The report as PDF."""

import json

import pandas as pd

from elastocal.report.pages import write_report
from elastocal.tables import headed_rows

from job import run


def compile_report(job):
    with open(job.input.answers, encoding="utf-8") as file:
        facts = json.load(file)
    tables = {name: headed_rows(pd.read_csv(job.input[name])) for name in ("table1", "table2", "table3", "table4")}
    write_report(job.output.report, facts, tables | {"figures": job.params.figures}, job.input.figures)


run(compile_report, snakemake)
