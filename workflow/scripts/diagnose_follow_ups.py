"""Verdicts anew on campaigns with further poses; this process opens no sealed file."""

import sys
from pathlib import Path
from typing import Any

from job import Job, run

from elastocal.io.json_files import write_json
from elastocal.loop.whole import diagnosed
from elastocal_proof.blind.follow_up import diagnosed_anew


def diagnose_follow_ups(job: Job) -> None:
    def verdict_on(folder: str) -> dict[str, Any]:
        print(f"{job.wildcards.block}: {Path(folder).parent.name}", file=sys.stderr, flush=True)
        return diagnosed(folder, job.params.robots, job.params.seed)

    write_json(job.output.verdicts, diagnosed_anew(job.input.campaigns, verdict_on), allow_nan=False)


run(diagnose_follow_ups, snakemake)
