"""Typeset a table as Markdown and LaTeX, each value with its standard error."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.io.data_frames import write_latex, write_markdown
from elastocal.study.tables import merge_errors


def typeset_table(job: Job) -> None:
    frame = pd.read_csv(job.input.table, keep_default_na=False, na_values=[""])
    shown = merge_errors(frame.drop(columns="strategy_file", errors="ignore"))
    write_markdown(job.output.markdown, shown, origin_of(job))
    write_latex(job.output.latex, shown, origin_of(job))


run(typeset_table, snakemake)
