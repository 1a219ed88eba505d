"""Copy pictures and tables of a finished run into docs, where the pages show them."""

import shutil

from job import Job, run


def copy_into_docs(job: Job) -> None:
    for source, copy in zip(job.input.sources, job.output.copies, strict=True):
        shutil.copyfile(source, copy)


run(copy_into_docs, snakemake)
