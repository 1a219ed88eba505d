"""Random configurations and wrenches of one robot."""

from elastocal.provenance import provenance
from elastocal.robot import robot_from_document
from elastocal.simulation import Loading
from elastocal.storage import write_table
from elastocal.study.simulate import experiment_blocks
from elastocal.table_schemas import experiments

from job import run


def draw_experiments(job):
    settings = job.params
    robot = robot_from_document(settings.robot)
    loading = Loading(**settings.loading)
    blocks = experiment_blocks(
        robot, job.wildcards.robot, settings.seed, loading, settings.purpose, settings.data_sets, settings.configurations
    )
    write_table(job.output.experiments, experiments(robot.joints), blocks, provenance(settings))


run(draw_experiments, snakemake)
