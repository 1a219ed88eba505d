"""Typeset the paper's tables and figures as one PDF, beside the printed ones."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.io.documents import read_document
from elastocal.report.study import format_paper_rows, shorten_titles
from elastocal.report.typesetting import compile_document


def compile_paper(job: Job) -> None:
    comparison = pd.read_csv(job.input.beside, dtype={"table": str})
    authors = [
        author["name"] for author in read_document(job.input.citation)["authors"]
    ]
    rows = format_paper_rows(
        comparison,
        shorten_titles(job.params.names),
        int(job.params.stated["configurations"]),
    )
    facts = job.params.stated | {"rows": rows, "authors": authors}
    compile_document(
        job.output.report,
        "paper.typ",
        {"facts": facts},
        job.input.figures,
        origin_of(job),
    )


run(compile_paper, snakemake)
