"""The report of the blind proof as PDF."""

from pathlib import Path

from job import Job, origin_of, run

import pandas as pd

from elastocal_proof.report.blind_facts import blind_facts
from elastocal_proof.report.blind_pages import write_blind_report

TABLES = ("summary", "settings", "power", "undetectable", "confusion", "cases", "follow_up", "sweep")


def compile_blind_report(job: Job) -> None:
    settings = job.params
    tables = {name: pd.read_csv(job.input[name]) for name in TABLES}
    manifest = Path(job.input.manifest).read_text(encoding="utf-8")
    facts = blind_facts(tables, manifest, settings.size, settings.seed)
    write_blind_report(job.output.report, facts, job.input.figures, origin_of(job))


run(compile_blind_report, snakemake)
