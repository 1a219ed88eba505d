"""What was sealed against what was said."""

from pathlib import Path

import pandas as pd

from elastocal.blind.scores import confused, outcome, summarized
from elastocal.blind.truths import opened_truths
from elastocal.frames import write_csv
from elastocal.json_files import read_json

from job import run


def score_cases(job):
    files = [file for folder in job.input.sealed for file in Path(folder).glob("*.json")]
    verdicts = {verdict["campaign"]: verdict for path in job.input.verdicts for verdict in read_json(path)}
    cases = pd.DataFrame([outcome(truth, verdicts[name]) for name, truth in opened_truths(files, job.input.manifest).items()])
    write_csv(job.output.cases, cases)
    write_csv(job.output.summary, summarized(cases))
    write_csv(job.output.confusion, confused(cases))


run(score_cases, snakemake)
