"""The report of a campaign as PDF."""

import pandas as pd

from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.diagnosis_tables import final_parameters
from elastocal.loop.schemas import STEPS, residuals
from elastocal.mechanics.robot_file import joint_count
from elastocal.report.loop_facts import loop_facts
from elastocal.report.loop_pages import write_loop_report

from job import Job, run


def compile_loop_report(job: Job) -> None:
    verdict, descriptions = read_json(job.input.verdict), read_json(job.input.descriptions)
    joints = joint_count(descriptions["robot"])
    rows = [pd.read_csv(path).to_dict("records") for path in (job.input.before_after, job.input.splits, job.input.experiment)]
    facts = loop_facts(
        verdict,
        *rows,
        read_table(job.input.residuals, residuals(joints)),
        descriptions,
        final_parameters(read_json(job.input.diagnosis), read_table(job.input.steps, STEPS)),
    )
    write_loop_report(job.output.report, facts, job.input.figures)


run(compile_loop_report, snakemake)
