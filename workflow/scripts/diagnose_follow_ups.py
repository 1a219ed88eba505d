"""Verdicts anew on campaigns with further poses; this process opens no sealed file."""

import json
import sys
from pathlib import Path

from elastocal.blind.follow_up import diagnosed_anew
from elastocal.frames import write_text
from elastocal.loop.whole import diagnosed

from job import run


def diagnose_follow_ups(job):
    settings = job.params

    def verdict_on(folder):
        print(f"{job.wildcards.block}: {Path(folder).parent.name}", file=sys.stderr, flush=True)
        return diagnosed(folder, "config/robots", settings.replicates, settings.seed)

    write_text(job.output.verdicts, json.dumps(diagnosed_anew(job.input.campaigns, verdict_on), allow_nan=False) + "\n")


run(diagnose_follow_ups, snakemake)
