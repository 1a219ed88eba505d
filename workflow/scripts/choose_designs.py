"""Random against optimal configurations of one robot."""

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import joint_limits, robot_from_document
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.simulation import Loading
from elastocal.study.steps.designs import design_worths
from elastocal.study.table_schemas import DESIGNS

from job import Job, run


def choose_designs(job: Job) -> None:
    settings, key = job.params, job.wildcards.robot
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    limits = joint_limits(settings.robot["joint_limits_deg"], robot.chain, key)
    interpretation = Interpretation(Loading(**settings.loading), **settings.interpretation)
    size = Size(**settings.size)
    blocks = [design_worths(robot, limits, key, settings.seed, interpretation, size, settings.candidates, settings.sizes)]
    write_table(job.output[0], DESIGNS, blocks, provenance(settings, **dict(job.wildcards)))


run(choose_designs, snakemake)
