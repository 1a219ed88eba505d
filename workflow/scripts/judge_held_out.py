"""Every model, and controls that should not help, on poses that no step has seen."""

import pandas as pd

from elastocal.attribution import by_effect
from elastocal.frames import write_csv
from elastocal.json_files import read_json, write_json
from elastocal.loop.case import noise_from
from elastocal.loop.judge import controls, judged, model_steps, residual_blocks, split_table
from elastocal.loop.opened import opened_case, opened_fit
from elastocal.loop.schemas import LOOKS, RIVALS, residuals
from elastocal.provenance import provenance
from elastocal.storage import read_table, write_table

from job import run


def judge_held_out(job):
    case = opened_case(job.input.descriptions, job.input.training)
    held_out = opened_case(job.input.descriptions, job.input.held_out, "held_out")
    declared, _ = opened_fit(case, job.input.declared, job.input.noise)
    final, found = opened_fit(case, job.input.parameters, job.input.noise, job.input.found)
    groups = by_effect(found)
    beside = controls(read_table(job.input.looks, LOOKS), read_table(job.input.rivals, RIVALS), groups, case.candidates)
    steps = model_steps(case, noise_from(read_json(job.input.noise)), declared, final, groups, beside)
    result = judged(steps, case, held_out, job.params.seed)
    write_csv(job.output.before_after, pd.DataFrame(result.rows))
    write_csv(job.output.splits, pd.DataFrame(split_table(steps, case, held_out, job.params.seed)))
    write_json(job.output.errors, {"heldout": result.heldout, "warnings": result.warnings})
    schema = residuals(case.campaign.robot.joints)
    write_table(job.output.residuals, schema, residual_blocks(steps, case, held_out), provenance(job.params, **job.wildcards))


run(judge_held_out, snakemake)
