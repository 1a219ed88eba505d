"""One strategy for one robot at one noise level: compliances at every prefix length, and what they are worth."""

from job import Job, run

from elastocal.io.provenance import provenance
from elastocal.io.storage import read_blocks, read_table, write_table
from elastocal.mechanics.robot import with_target_offset
from elastocal.mechanics.robot_file import robot_from_document
from elastocal.study.steps.columns import DEFLECTION_COLUMNS
from elastocal.study.steps.evaluate import evaluate_strategy, judge_from
from elastocal.study.steps.identify import identified_blocks, paired_blocks
from elastocal.study.steps.weights import DATA_SETS, TESTS
from elastocal.study.strategies import drop_forgotten_stages, strategy_from_document
from elastocal.study.table_schemas import DEFLECTIONS, REPLICATES, WEIGHTS, accuracy, experiments, identified, metrics


def identify(job: Job) -> None:
    settings, origin = job.params, provenance(job.params, **dict(job.wildcards))
    robot = with_target_offset(robot_from_document(settings.robot), settings.tool_offset_m)
    chain, n = robot.chain, robot.joints
    strategy = strategy_from_document(settings.strategy)
    blocks = paired_blocks(
        read_blocks(job.input.experiments, experiments(n)),
        {name: read_blocks(job.input.measured, DEFLECTIONS, DEFLECTION_COLUMNS, point=name) for name in strategy.points},
    )
    solvable = drop_forgotten_stages(strategy, n) if settings.start is None else strategy
    solved = identified_blocks(blocks, chain, solvable, settings.rows, settings.wrench_at, settings.start)
    write_table(job.output.identified, identified(n), solved, origin)

    judge = judge_from(
        robot,
        read_table(job.input.test_experiments, experiments(n)),
        read_table(job.input.test_ideal, DEFLECTIONS, point=chain.end_effector.name),
        settings.wrench_at,
    )
    counts = ["replicate", "count"]
    # Read again, so that any number of data sets is worked off in the same memory.
    tables = evaluate_strategy(
        read_blocks(job.output.identified, identified(n), ["data_set", *(f"c{j + 1}" for j in range(n))]),
        read_blocks(job.input.weights, WEIGHTS, counts, members=DATA_SETS),
        read_table(job.input.weights, WEIGHTS, counts, members=TESTS),
        judge,
        strategy.fixed_joints,
        settings.average,
        settings.deviation_of,
        settings.lengths,
    )
    scores = (job.output.metrics, metrics(n)), (job.output.replicates, REPLICATES), (job.output.accuracy, accuracy(n))
    for (path, schema), table in zip(scores, tables, strict=True):
        write_table(path, schema, [table], origin)


run(identify, snakemake)
