"""Deflections of one robot without noise."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.steps.simulate import ideal_blocks
from elastocal.study.table_schemas import DEFLECTIONS, experiments


def simulate(job: Job) -> None:
    settings = job.params
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    blocks = read_blocks(job.input.experiments, experiments(robot.joints))
    write_table(job.output.ideal, DEFLECTIONS, ideal_blocks(blocks, robot, settings.wrench_at), provenance(settings))


run(simulate, snakemake)
