"""How often the name is right after further poses, proposed or random: the sealed ground truth against the verdict then."""

from pathlib import Path

from job import Job, run

import pandas as pd

from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json
from elastocal_proof.blind.folders import load_ground_truth
from elastocal_proof.blind.follow_up_scores import (
    followed,
    poses_needed,
    promised,
    promises_kept,
    rates,
    with_one_effect,
    with_prospects,
)


def score_follow_ups(job: Job) -> None:
    files = [file for folder in job.input.sealed for file in Path(folder).glob("*.json")]
    truths = load_ground_truth(files, job.input.manifest)
    first = {verdict["campaign"]: verdict for path in job.input.first for verdict in read_json(path)}
    anew = [entry for path in job.input.anew for entry in read_json(path)]
    proposals = pd.concat([pd.read_csv(path) for path in job.input.proposals], ignore_index=True)
    cases = followed(truths, first, anew, promised(proposals))
    one = with_one_effect(cases)
    write_csv(job.output.cases, cases)
    write_csv(job.output.rates, rates(cases[one]))
    write_csv(job.output.separable, rates(cases[one & with_prospects(cases)]))
    write_csv(job.output.others, rates(cases[~one]))
    write_csv(job.output.promises, promises_kept(cases[one]))
    write_csv(job.output.poses, poses_needed(cases[one]))


run(score_follow_ups, snakemake)
