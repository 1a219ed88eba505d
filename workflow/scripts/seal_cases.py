"""The commitment: SHA-256 of every ground truth, before any diagnosis."""

import hashlib
from pathlib import Path

from job import Job, run

from elastocal_proof.blind.cases import write_manifest


def seal_cases(job: Job) -> None:
    files = [file for folder in job.input.sealed for file in Path(folder).glob("*.json")]
    write_manifest(job.output.manifest, {file.stem: hashlib.sha256(file.read_bytes()).hexdigest() for file in files})


run(seal_cases, snakemake)
