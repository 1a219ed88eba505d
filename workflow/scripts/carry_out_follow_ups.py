"""Proposed experiments, and random ones beside them, on the robots of their cases."""

from pathlib import Path

from job import Job, run

import pandas as pd

from elastocal.mechanics.components import WRENCH_NAMES
from elastocal_proof.blind.carrying_out import carry_out
from elastocal_proof.blind.cases import SIZES, cases_of


def carry_out_follow_ups(job: Job) -> None:
    Path(job.output.campaigns).mkdir(parents=True, exist_ok=True)
    robots = Path(job.input.robots[0]).parent
    cases = {case.name: case for case in cases_of(SIZES[job.params.size], job.params.seed)}
    for name, states in pd.read_csv(job.input.proposals).groupby("case"):
        # A block has arms of six joints and of seven.
        shown = states.filter(regex=r"^q\d+$").dropna(axis=1).to_numpy()
        wrench = states[list(WRENCH_NAMES)].to_numpy()
        carry_out(cases[name], shown, wrench, job.output.campaigns, robots)


run(carry_out_follow_ups, snakemake)
