"""Scores of further studies of one robot, at the noise of the tables."""

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import joint_limits, robot_from_document
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.simulation import Loading
from elastocal.study.steps.repeat import repeated_blocks
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import repeated

from job import Job, run


def repeat_studies(job: Job) -> None:
    settings, key = job.params, job.wildcards.robot
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    blocks = repeated_blocks(
        robot,
        joint_limits(settings.robot["joint_limits_deg"], robot.chain, key),
        key,
        settings.seed,
        range(1, settings.studies + 1),
        [strategy_from_document(document) for document in settings.strategies],
        Interpretation(Loading(**settings.loading), **settings.interpretation),
        Size(**settings.size),
    )
    write_table(job.output.repeated, repeated(robot.joints), blocks, provenance(settings, **dict(job.wildcards)))


run(repeat_studies, snakemake)
