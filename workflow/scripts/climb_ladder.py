"""Models of one robot with more and more link springs."""

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import joint_limits, robot_from_document
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.simulation import Loading
from elastocal.study.steps.ladder import ladder_blocks
from elastocal.study.table_schemas import LADDER

from job import Job, run


def climb_ladder(job: Job) -> None:
    settings, key = job.params, job.wildcards.robot
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    limits = joint_limits(settings.robot["joint_limits_deg"], robot.chain, key)
    interpretation = Interpretation(Loading(**settings.loading), **settings.interpretation)
    blocks = ladder_blocks(
        robot, limits, key, settings.seed, interpretation, Size(**settings.size), settings.lengths, settings.noises
    )
    write_table(job.output[0], LADDER, blocks, provenance(settings, **dict(job.wildcards)))


run(climb_ladder, snakemake)
