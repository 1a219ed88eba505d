"""Write the report of a campaign as PDF and as an interactive page."""

from job import Job, origin_of, run

import pandas as pd

from elastocal.io.json_files import read_json
from elastocal.io.storage import read_table
from elastocal.loop.diagnosis_tables import select_final_parameters
from elastocal.loop.schemas import STEPS, read_residuals
from elastocal.mechanics.robot_file import parse_robot
from elastocal.report.loop_facts import collect_loop_facts
from elastocal.report.loop_page import build_loop_page, write_loop_page
from elastocal.report.typesetting import compile_document
from elastocal.verdict import read_verdict


def compile_loop_report(job: Job) -> None:
    verdict = read_verdict(job.input.verdict)
    descriptions = read_json(job.input.descriptions)
    robot = parse_robot(descriptions["robot"])
    rows = [
        pd.read_csv(path).to_dict("records")
        for path in (job.input.before_after, job.input.experiment)
    ]
    table = read_residuals(job.input.residuals, robot.joints)
    parameters = select_final_parameters(
        read_json(job.input.diagnosis), read_table(job.input.steps, STEPS)
    )
    facts = collect_loop_facts(verdict, *rows, table, descriptions, parameters)
    compile_document(
        job.output.report,
        "loop.typ",
        {"facts": facts},
        job.input.figures,
        origin_of(job),
    )
    write_loop_page(
        job.output.page, *build_loop_page(facts, table, robot), origin_of(job)
    )


run(compile_loop_report, snakemake)
