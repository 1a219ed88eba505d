"""A block of blind cases: campaigns for the analyst, and their ground truths, sealed."""

from pathlib import Path

from job import Job, run

from elastocal_proof.blind.cases import SIZES, block_of, cases_of, make_case


def make_cases(job: Job) -> None:
    settings, robots = job.params, Path(job.input.robots[0]).parent
    for folder in (job.output.blind, job.output.sealed):
        Path(folder).mkdir(parents=True, exist_ok=True)
    for case in block_of(cases_of(SIZES[settings.size], settings.seed), settings.number, settings.blocks):
        make_case(case, job.output.blind, job.output.sealed, robots)


run(make_cases, snakemake)
