"""Cramér-Rao bounds of one robot for every set of measuring points that a strategy reads."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, read_table, write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.steps.bound import bound_blocks
from elastocal.study.steps.evaluate import judge_from
from elastocal.study.table_schemas import BOUNDS, DEFLECTIONS, experiments


def bound(job: Job) -> None:
    settings = job.params
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    schema, end_effector = experiments(robot.joints), robot.chain.end_effector.name
    judge = judge_from(
        robot,
        read_table(job.input.test_experiments, schema),
        read_table(job.input.test_ideal, DEFLECTIONS, point=end_effector),
        settings.wrench_at,
    )
    blocks = bound_blocks(
        read_blocks(job.input.experiments, schema), robot.chain, settings.point_sets, settings.rows, settings.wrench_at, judge
    )
    write_table(job.output.bounds, BOUNDS, blocks, provenance(settings))


run(bound, snakemake)
