"""Typeset the paper's tables and figures as one PDF, beside the printed ones."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.io.documents import read_document
from elastocal.report.study import (
    format_paper_rows,
    format_pooled_deflections,
    shorten_titles,
)
from elastocal.report.typesetting import compile_document


def compile_paper(job: Job) -> None:
    comparison = pd.read_csv(job.input.beside, dtype={"table": str})
    authors = [
        author["name"] for author in read_document(job.input.citation)["authors"]
    ]
    names = shorten_titles(job.params.names)
    configurations = int(job.params.stated["configurations"])
    rows = format_paper_rows(comparison, names, configurations)
    facts = job.params.stated | {
        "rows": rows,
        "authors": authors,
        "titles": [names[robot] for robot in job.params.robots],
        "table2_pooled": format_pooled_deflections(
            pd.read_csv(job.input.table2), names
        ),
    }
    compile_document(
        job.output.report,
        "paper.typ",
        {"facts": facts},
        job.input.figures,
        origin_of(job),
    )


run(compile_paper, snakemake)
