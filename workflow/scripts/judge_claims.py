"""Each claim of the paper beside what studies of its size find."""

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import read_long, read_studies, write_csv
from elastocal.study.claims import Evidence, claims_table
from elastocal.study.table_schemas import expected, repeated


def judge_claims(job: Job) -> None:
    settings, given = job.params, job.input
    names = ("comparison", "solvers", "starts", "stiffness", "designs", "pairs", "score_pairs")
    tables = {name: pd.read_csv(given[name], dtype={"table": str}) for name in names}
    studies, expectations = read_studies(given.studies, repeated), read_long(given.expected, expected)
    evidence = Evidence(studies, expectations, tables, settings.length, tuple(settings.robots))
    write_csv(job.output.table, claims_table(evidence))


run(judge_claims, snakemake)
