"""Observability indices of one robot's data sets, beside what they are worth."""

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import joint_limits, robot_from_document
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.simulation import Loading
from elastocal.study.steps.observability import observability_columns
from elastocal.study.table_schemas import OBSERVABILITY

from job import Job, run


def index_observability(job: Job) -> None:
    settings, key = job.params, job.wildcards.robot
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    limits = joint_limits(settings.robot["joint_limits_deg"], robot.chain, key)
    interpretation = Interpretation(Loading(**settings.loading), **settings.interpretation)
    blocks = [observability_columns(robot, limits, key, settings.seed, interpretation, Size(**settings.size))]
    write_table(job.output[0], OBSERVABILITY, blocks, provenance(settings, **dict(job.wildcards)))


run(index_observability, snakemake)
