"""The report of a campaign as PDF."""

import pandas as pd

from elastocal.json_files import read_json
from elastocal.loop.schemas import CANDIDATES, PARAMETERS, residuals
from elastocal.report.loop_facts import loop_facts
from elastocal.report.loop_pages import write_loop_report
from elastocal.storage import read_table

from job import run


def compile_loop_report(job):
    verdict, descriptions = read_json(job.input.verdict), read_json(job.input.descriptions)
    joints = len(descriptions["robot"]["compliance_urad_per_Nm"])
    facts = loop_facts(
        verdict,
        pd.read_csv(job.input.before_after).to_dict("records"),
        pd.read_csv(job.input.experiment).to_dict("records"),
        read_table(job.input.residuals, residuals(joints)),
        read_table(job.input.candidates, CANDIDATES),
        descriptions,
        read_table(job.input.parameters, PARAMETERS),
        job.params.replicates,
    )
    write_loop_report(job.output.report, facts, job.input.figures)


run(compile_loop_report, snakemake)
