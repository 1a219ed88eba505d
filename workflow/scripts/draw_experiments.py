"""Random configurations and wrenches of one robot."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import write_table
from elastocal.mechanics.chain import parse_chain
from elastocal.mechanics.robot_file import joint_limits
from elastocal.study.simulation import Loading
from elastocal.study.steps.simulate import experiment_blocks
from elastocal.study.table_schemas import experiments


def draw_experiments(job: Job) -> None:
    settings, robot = job.params, job.wildcards.robot
    chain = parse_chain(settings.chain, settings.lengths_m, robot)
    limits = joint_limits(settings.joint_limits_deg, chain, robot)
    loading = Loading(**settings.loading)
    blocks = experiment_blocks(
        chain, limits, robot, settings.seed, loading, settings.purpose, settings.data_sets, settings.configurations
    )
    write_table(job.output.experiments, experiments(chain.coordinates), blocks, provenance(settings))


run(draw_experiments, snakemake)
