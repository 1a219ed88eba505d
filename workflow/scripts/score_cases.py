"""What was sealed against what was said."""

import hashlib
import json
from pathlib import Path

import pandas as pd

from elastocal.blind.scores import confused, outcome, summarized
from elastocal.errors import InputError
from elastocal.frames import write_csv

from job import run


def score_cases(job):
    promised = dict(reversed(line.split()) for line in Path(job.input.manifest).read_text(encoding="utf-8").splitlines())
    verdicts = {v["campaign"]: v for path in job.input.verdicts for v in json.loads(Path(path).read_text(encoding="utf-8"))}
    rows = []
    for file in sorted(file for folder in job.input.sealed for file in Path(folder).glob("*.json")):
        found = hashlib.sha256(file.read_bytes()).hexdigest()
        if promised.get(file.name) != found:
            raise InputError(file, "", f"SHA-256 {found}", f"{promised.get(file.name)}, as sealed")
        rows.append(outcome(json.loads(file.read_text(encoding="utf-8")), verdicts[file.stem]))
    cases = pd.DataFrame(rows)
    write_csv(job.output.cases, cases)
    write_csv(job.output.summary, summarized(cases))
    write_csv(job.output.confusion, confused(cases))


run(score_cases, snakemake)
