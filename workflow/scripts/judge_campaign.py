"""The verdict on a campaign: every model on poses that no step has seen."""

from job import Job, run

import pandas as pd

from elastocal.diagnosis.judge import residual_blocks, split_table
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import read_json, write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import read_table, write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.case_files import load_case
from elastocal.loop.schemas import STEPS, residuals
from elastocal.loop.whole import judged


def judge_campaign(job: Job) -> None:
    case = load_case(job.input.descriptions, job.input.training)
    held_out = load_case(job.input.descriptions, job.input.held_out, "held_out")
    found = tables.diagnosis_from(case, read_json(job.input.diagnosis), read_table(job.input.steps, STEPS))
    verdict = judged(found, held_out, job.params.seed)
    write_json(job.output.verdict, verdict.document, allow_nan=False)
    write_csv(job.output.before_after, pd.DataFrame(verdict.rows))
    write_csv(job.output.splits, pd.DataFrame(split_table(found, verdict.held_out, job.params.seed)))
    schema = residuals(case.campaign.robot.joints)
    origin = provenance(job.params, **job.wildcards)
    write_table(job.output.residuals, schema, residual_blocks(found, verdict), origin)


run(judge_campaign, snakemake)
