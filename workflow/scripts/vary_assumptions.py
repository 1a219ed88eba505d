"""What known geometry and equal noise are worth, for one robot."""

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import joint_limits, robot_from_document
from elastocal.study.interpretation import Interpretation, Size
from elastocal.study.simulation import Loading
from elastocal.study.steps.assumptions import geometry_rows, weighting_rows
from elastocal.study.table_schemas import GEOMETRY, WEIGHTING

from job import Job, run


def vary_assumptions(job: Job) -> None:
    settings, key = job.params, job.wildcards.robot
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    limits = joint_limits(settings.robot["joint_limits_deg"], robot.chain, key)
    interpretation = Interpretation(Loading(**settings.loading), **settings.interpretation)
    given = (robot, limits, key, settings.seed, interpretation, Size(**settings.size))
    origin = provenance(settings, **dict(job.wildcards))
    write_table(job.output.geometry, GEOMETRY, [geometry_rows(*given, **settings.geometry)], origin)
    write_table(job.output.weighting, WEIGHTING, [weighting_rows(*given, **settings.weighting)], origin)


run(vary_assumptions, snakemake)
