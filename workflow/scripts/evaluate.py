"""Metrics of one strategy for one robot at one noise level."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, read_table, write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.steps.evaluate import evaluated, judge_from
from elastocal.study.steps.weights import DATA_SETS, TESTS
from elastocal.study.strategies import strategy_from_document
from elastocal.study.table_schemas import DEFLECTIONS, REPLICATES, WEIGHTS, accuracy, experiments, identified, metrics


def evaluate(job: Job) -> None:
    settings = job.params
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    n, end_effector = robot.joints, robot.chain.end_effector.name
    judge = judge_from(
        robot,
        read_table(job.input.test_experiments, experiments(n)),
        read_table(job.input.test_ideal, DEFLECTIONS, point=end_effector),
        settings.wrench_at,
    )
    needed = ["data_set", *(f"c{j + 1}" for j in range(n))]
    counts = ["replicate", "count"]
    tables = evaluated(
        read_blocks(job.input.identified, identified(n), needed),
        read_blocks(job.input.weights, WEIGHTS, counts, members=DATA_SETS),
        read_table(job.input.weights, WEIGHTS, counts, members=TESTS),
        judge,
        strategy_from_document(settings.strategy).fixed_joints,
        settings.average,
        settings.deviation_of,
        settings.lengths,
    )
    origin = provenance(settings, **dict(job.wildcards))
    for path, schema, table in zip(job.output, (metrics(n), REPLICATES, accuracy(n)), tables, strict=True):
        write_table(path, schema, [table], origin)


run(evaluate, snakemake)
