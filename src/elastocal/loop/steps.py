"""The steps that diagnose and judge a campaign, as rules call them: from files to files."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import pandas as pd

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.judge import residual_blocks, split_table
from elastocal.diagnosis.next_experiment import propose
from elastocal.diagnosis.proposal import facts_of, table_of
from elastocal.diagnosis.settings import Settings
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json, write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop import schemas
from elastocal.loop.whole import judged
from elastocal.random_streams import stream


def diagnose_campaign(job: Any) -> None:
    """What the training poses say: faults, noise, declared model, missing mechanisms and the next experiment."""
    case = tables.load_case(job.input.descriptions, job.input.training)
    name, seed = job.wildcards.campaign, job.params.seed
    found = diagnose(case, Settings(), seed, lambda line: print(f"{name}: {line}", file=sys.stderr, flush=True))
    robot, draws = case.campaign.robot, stream(seed, case.campaign.name, "next experiment", 0)
    proposal = propose(found, robot.joint_limits, Settings(), draws, job.params.states)
    write_csv(job.output.experiment, table_of(proposal, robot))
    found = replace(found, document=found.document | {"next_experiment": facts_of(proposal)})
    write_json(job.output.diagnosis, tables.diagnosis_facts(found))
    origin = provenance(job.params, **job.wildcards)
    write_table(job.output.steps, schemas.STEPS, tables.step_blocks(found), origin)
    for path, schema, columns in (
        (job.output.correlations, schemas.CORRELATIONS, tables.correlation_columns(found.final)),
        (job.output.models, schemas.MODELS, tables.model_columns(found)),
        (job.output.candidates, schemas.CANDIDATES, tables.candidate_columns(found)),
        (job.output.confounding, schemas.CONFOUNDING, tables.confounding_columns(found)),
    ):
        write_table(path, schema, [columns], origin)


def judge_campaign(job: Any) -> None:
    """The verdict: every model on poses that no step has seen."""
    case = tables.load_case(job.input.descriptions, job.input.training)
    held_out = tables.load_case(job.input.descriptions, job.input.held_out, "held_out")
    found = tables.diagnosis_from(case, read_json(job.input.diagnosis), read_table(job.input.steps, schemas.STEPS))
    verdict = judged(found, held_out, job.params.seed)
    write_json(job.output.verdict, verdict.document, allow_nan=False)
    write_csv(job.output.before_after, pd.DataFrame(verdict.rows))
    write_csv(job.output.splits, pd.DataFrame(split_table(found, verdict.held_out, job.params.seed)))
    schema = schemas.residuals(case.campaign.robot.joints)
    write_table(job.output.residuals, schema, residual_blocks(found, verdict), provenance(job.params, **job.wildcards))
