"""Every number that the report's text states."""

import json

import pandas as pd

from elastocal.io.atomic_writes import write_text
from elastocal.io.data_frames import read_long
from elastocal.report.answers import answers
from elastocal.study.table_schemas import REPLICATES, metrics

from job import Job, run


def state_answers(job: Job) -> None:
    settings = job.params
    facts = answers(
        comparison=pd.read_csv(job.input.comparison, dtype={"table": str}),
        table2=pd.read_csv(job.input.table2),
        per_dataset=pd.read_csv(job.input.per_dataset),
        extended=pd.read_csv(job.input.extended),
        solvers=pd.read_csv(job.input.solvers),
        metrics=read_long(job.input.metrics, metrics),
        replicates=read_long(job.input.replicates, lambda joints: REPLICATES),
        noisiest=read_long(job.input.noisiest, metrics),
        titles=settings.titles,
        cells=settings.cells,
    )
    write_text(job.output.answers, json.dumps(facts, indent=1, ensure_ascii=False, allow_nan=False))


run(state_answers, snakemake)
