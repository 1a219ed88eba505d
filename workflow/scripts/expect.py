"""Expectations of the scores of one strategy on one robot in closed form."""

from job import Job, run

import numpy as np

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, read_table, write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.steps.evaluate import judge_from
from elastocal.study.steps.expect import expected_scores
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import DEFLECTIONS, design, expected, experiments, metrics


def expect(job: Job) -> None:
    settings = job.params
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    n = robot.joints
    judge = judge_from(
        robot,
        read_table(job.input.test_experiments, experiments(n)),
        read_table(job.input.test_ideal, DEFLECTIONS, point=robot.chain.end_effector.name),
        settings.wrench_at,
    )
    noise_free = None
    if job.input.get("noise_free"):
        averaged = [f"compliance_{j + 1}" for j in range(n)]
        noise_free = np.stack([*read_table(job.input.noise_free, metrics(n), averaged).values()], axis=1)
    scores = expected_scores(
        read_blocks(job.input.design, design(n)),
        noise_free,
        1e-6 * float(job.wildcards.noise),
        robot,
        judge,
        strategy_from_document(settings.strategy).fixed_joints,
        settings.average,
        settings.deviation_of,
    )
    write_table(job.output.expected, expected(n), [scores], provenance(settings, **dict(job.wildcards)))


run(expect, snakemake)
