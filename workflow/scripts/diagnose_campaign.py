"""What the training poses of a campaign say: faults, noise, declared model, missing mechanisms and the next experiment."""

import sys
from dataclasses import replace

from job import Job, run

from elastocal.diagnosis.diagnose import diagnose
from elastocal.diagnosis.next_experiment import facts_of, propose, table_of
from elastocal.diagnosis.settings import Settings
from elastocal.io.data_frames import write_csv
from elastocal.io.json_files import write_json
from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.loop import diagnosis_tables as tables
from elastocal.loop.case_files import load_case
from elastocal.loop.schemas import CANDIDATES, CONFOUNDING, CORRELATIONS, MODELS, STEPS
from elastocal.random_streams import stream


def diagnose_campaign(job: Job) -> None:
    case = load_case(job.input.descriptions, job.input.training)
    campaign = job.wildcards.campaign
    found = diagnose(case, Settings(), job.params.seed, lambda line: print(f"{campaign}: {line}", file=sys.stderr, flush=True))
    robot, draws = case.campaign.robot, stream(job.params.seed, case.campaign.name, "next experiment", 0)
    proposal = propose(found, robot.joint_limits, Settings(), draws, job.params.states)
    write_csv(job.output.experiment, table_of(proposal, robot))
    found = replace(found, document=found.document | {"next_experiment": facts_of(proposal)})
    origin = provenance(job.params, **job.wildcards)
    write_json(job.output.diagnosis, tables.diagnosis_facts(found))
    write_table(job.output.steps, STEPS, tables.step_blocks(found), origin)
    write_table(job.output.correlations, CORRELATIONS, [tables.final_correlations(found)], origin)
    write_table(job.output.models, MODELS, [tables.model_columns(found)], origin)
    write_table(job.output.candidates, CANDIDATES, [tables.candidate_columns(found)], origin)
    write_table(job.output.confounding, CONFOUNDING, [tables.confounding_columns(found)], origin)


run(diagnose_campaign, snakemake)
