"""Errors and bounds of one robot for every set of measuring points."""

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import joint_limits, robot_from_document
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.simulation import Loading
from elastocal.study.steps.budget import budget_blocks
from elastocal.study.table_schemas import BUDGET

from job import Job, run


def compare_point_sets(job: Job) -> None:
    settings, key = job.params, job.wildcards.robot
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    limits = joint_limits(settings.robot["joint_limits_deg"], robot.chain, key)
    interpretation = Interpretation(Loading(**settings.loading), **settings.interpretation)
    blocks = budget_blocks(robot, limits, key, settings.seed, settings.point_sets, interpretation, Size(**settings.size))
    write_table(job.output[0], BUDGET, blocks, provenance(settings, **dict(job.wildcards)))


run(compare_point_sets, snakemake)
