"""Verdicts on a block of blind cases; this process opens no sealed file."""

import json
import sys
from pathlib import Path

from job import Job, run

from elastocal.io.atomic_writes import write_text
from elastocal.loop.whole import diagnosed


def diagnose_cases(job: Job) -> None:
    folders = sorted(folder for folder in Path(job.input.blind).iterdir() if folder.is_dir())
    verdicts = []
    for number, folder in enumerate(folders, 1):
        verdicts.append(diagnosed(folder.as_posix(), job.params.robots, job.params.seed))
        print(f"{job.wildcards.block}: {number} of {len(folders)} cases", file=sys.stderr, flush=True)
    write_text(job.output.verdicts, json.dumps(verdicts, allow_nan=False) + "\n")


run(diagnose_cases, snakemake)
