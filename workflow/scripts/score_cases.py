"""The sealed ground truth against the verdicts."""

from pathlib import Path

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal_proof.blind.calibration import reliability, statements
from elastocal_proof.blind.case_rows import case_row
from elastocal_proof.blind.confusion import confused
from elastocal_proof.blind.coverage import covered, intervals_of
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.power import powers, undetectable
from elastocal_proof.blind.targets import by_setting, summarized


def score_cases(job: Job) -> None:
    truths = load_ground_truth(
        [file for folder in job.input.sealed for file in Path(folder).glob("*.json")], job.input.manifest
    )
    verdicts = {verdict["campaign"]: verdict for path in job.input.verdicts for verdict in read_json(path)}
    oracles = {name: found for path in job.input.oracles for name, found in read_json(path).items()}
    cases = pd.DataFrame([case_row(truth, verdicts[name], **oracles[name]) for name, truth in truths.items()])
    intervals = pd.DataFrame([row for name, truth in truths.items() for row in intervals_of(truth, verdicts[name])])
    stated = statements((truth, verdicts[name]) for name, truth in truths.items())
    write_csv(job.output.cases, cases)
    write_csv(job.output.probabilities, stated)
    write_csv(job.output.reliability, reliability(stated))
    write_csv(job.output.summary, summarized(cases, intervals, stated, job.params.seed))
    write_csv(job.output.settings, by_setting(cases))
    write_csv(job.output.confusion, confused(cases))
    write_csv(job.output.power, powers(cases))
    write_csv(job.output.coverage, covered(intervals))
    write_csv(job.output.undetectable, undetectable(cases))


run(score_cases, snakemake)
